#include "scene/lot.hpp"

#include <algorithm>
#include <vector>

#include "scene/furniture.hpp"

namespace apgm::samples {
namespace {

constexpr double kTaken = 0.7;  // share of bays with a car

void add_road(Scene& scene) {
  scene.add_asphalt(rect_of({{0, 8}, {120, 16}}));
  for (const double y : {8.4, 15.4}) scene.add_paint(rect_of({{0, y}, {120, y + kLine_m}}));
  for (double x = 1; x < 120; x += 6) {
    if (x > 76 && x < 86) continue;  // the crossing
    scene.add_paint(rect_of({{x, 12 - kLine_m / 2}, {x + 3, 12 + kLine_m / 2}}));
  }
  for (double y = 8.9; y < 15; y += 1.2) scene.add_paint(rect_of({{79, y}, {83, y + 0.6}}));
}

void add_lot(Scene& scene, std::uint64_t seed) {
  scene.add_asphalt(rect_of({{14, 20}, {104, 55}}));
  scene.add_asphalt(rect_of({{52, 16}, {60, 20}}));  // driveway
  add_bays(scene, {16, 20}, 14, kTaken, seed);
  add_bays(scene, {61, 20}, 16, kTaken, seed + 1);
  add_bays(scene, {21, 32}, 30, kTaken, seed + 2);
  add_bays(scene, {21, 37}, 30, kTaken, seed + 3);
  add_bays(scene, {16, 49}, 34, kTaken, seed + 4);
  scene.add_paint(rect_of({{21, 37 - kLine_m / 2}, {96, 37 + kLine_m / 2}}));
  // Kerb stones close the ends of the middle rows and flank the driveway.
  for (const double x : {20.0, 96.4}) scene.add_wall(rect_of({{x, 32}, {x + 0.3, 42}}));
  for (const double x : {51.4, 60.3}) scene.add_wall(rect_of({{x, 18}, {x + 0.3, 25}}));
}

void add_buildings(Scene& scene) {
  add_building(scene, rect_of({{28, 61}, {92, 77}}));
  for (double x = 28; x <= 92; x += 5.333) scene.add_wall(rect_of({{x - 0.25, 57}, {x + 0.25, 57.5}}));
  add_building(scene, rect_of({{70, 0.5}, {114, 4.5}}));
  scene.add_wall(rect_of({{6, 20}, {6.3, 70}}));
}

void add_round_things(Scene& scene) {
  for (double x = 5; x < 120; x += 15) scene.add_post({{x, 17}, 0.12});
  for (double x = 4; x < 66; x += 9) scene.add_post({{x, 4.5}, 0.35});
  for (double y = 22; y < 72; y += 8) scene.add_post({{110, y}, 0.3});
  for (double x = 10; x < 26; x += 5) scene.add_post({{x, 66}, 0.4});
}

/// Poses every `step_m` along a polyline, headed along the chord of the 3 m around them.
std::vector<VehiclePose> follow(const std::vector<Point>& corners, double step_m) {
  std::vector<double> reached{0};
  for (std::size_t i = 1; i < corners.size(); ++i) {
    reached.push_back(reached.back() + length(corners[i] - corners[i - 1]));
  }
  const auto at = [&](double s) {
    std::size_t i = 1;
    while (i + 1 < corners.size() && reached[i] < s) ++i;
    const double share = std::clamp((s - reached[i - 1]) / (reached[i] - reached[i - 1]), 0.0, 1.0);
    return corners[i - 1] + share * (corners[i] - corners[i - 1]);
  };
  std::vector<VehiclePose> poses;
  const int count = static_cast<int>(reached.back() / step_m);
  for (int k = 0; k <= count; ++k) {
    const double s = k * step_m;
    poses.push_back({at(s), unit(at(s + 1.5) - at(s - 1.5))});
  }
  return poses;
}

}  // namespace

Scene lot_scene(std::uint64_t seed) {
  Scene scene({{0, 0}, {120, 80}}, {-24, -30});
  add_road(scene);
  add_lot(scene, seed);
  add_buildings(scene);
  add_round_things(scene);
  return scene;
}

Drive drive_a() {
  return {follow({{24, 45.5},
                  {94, 45.5},
                  {98, 44},
                  {99.5, 40},
                  {99.5, 33},
                  {97, 29.5},
                  {92, 28.5},
                  {60, 28.5},
                  {57, 27},
                  {56, 23},
                  {56, 15},
                  {58, 11},
                  {63, 10},
                  {112, 10}},
                 2.5)};
}

Drive drive_b() { return {follow({{116, 13.8}, {6, 13.8}}, 2.5), 60'000'000'000}; }

}  // namespace apgm::samples
