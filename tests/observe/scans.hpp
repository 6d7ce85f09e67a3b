#pragma once

#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include "apgm/observe/model.hpp"

namespace apgm::test {

using Random = std::mt19937_64;

inline double uniform(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

inline Frame frame_of_8_m() {
  Frame frame;
  frame.edge_um = 8'000'000;
  return frame;
}

inline StepOf always(int step) {
  return [step](PatchIndex) { return step; };
}

inline RangeScan scan_of(Point origin, const std::vector<Point>& returns) {
  RangeScan scan;
  scan.origin = origin;
  scan.stamp_ns = 5;
  for (const Point& p : returns) scan.beams.push_back({origin, p, true});
  return scan;
}

inline RangeScan random_scan(Random& random, int beams, double reach_m, double hits = 0.8) {
  RangeScan scan = scan_of({uniform(random, -4, 4), uniform(random, -4, 4)}, {});
  for (int i = 0; i < beams; ++i) {
    const Point to{scan.origin.x_m + uniform(random, -reach_m, reach_m),
                   scan.origin.y_m + uniform(random, -reach_m, reach_m)};
    scan.beams.push_back({scan.origin, to, uniform(random, 0, 1) < hits});
  }
  return scan;
}

inline Models models_of(ModelKind kind) {
  Models models;
  models.kind = kind;
  return models;
}

inline LabelledGround image_of(std::vector<LabelledGround::Pixel> pixels) {
  LabelledGround image;
  image.pixels = std::move(pixels);
  image.stamp_ns = 9;
  return image;
}

}  // namespace apgm::test
