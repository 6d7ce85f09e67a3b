#pragma once

#include <cmath>
#include <cstdint>

#include "apgm/core/map.hpp"

namespace apgm::samples {

/// Cells of one layer type of a map, counted from the datum across all patches: cell (i, j) has its
/// lower-left corner at d_g + (e / 2^r)(i, j). Patches are made when they are first asked for. Must not
/// outlive its map.
class CellGrid {
 public:
  CellGrid(Map& map, TypeId type, int step) : map_(map), type_(type), step_(step) {}

  double cell_m() const { return map_.header().frame.cell_m(step_); }
  float& at(int channel, std::int64_t i, std::int64_t j) {
    const std::int64_t side = std::int64_t{1} << step_;
    const PatchIndex patch{static_cast<std::int32_t>(floor_div(i, side)),
                           static_cast<std::int32_t>(floor_div(j, side))};
    if (layer_ == nullptr || patch != patch_) {
      patch_ = patch;
      layer_ = &map_.layer(patch, type_, step_);
    }
    return layer_->at(channel, {static_cast<std::int32_t>(i - patch.x * side),
                                static_cast<std::int32_t>(j - patch.y * side)});
  }

 private:
  Map& map_;
  TypeId type_;
  int step_;
  PatchIndex patch_;
  Layer* layer_ = nullptr;  // of patch_; references to a map's layers stay valid
};

/// Visits the cells a segment crosses, from the cell of `from` to the cell of `to`, each once, neighbours
/// sharing a side (after Amanatides and Woo, "A fast voxel traversal algorithm", 1987). Coordinates in cells.
/// @param visit  called as visit(i, j, last)
template <class Visit>
void traverse(Point from, Point to, Visit visit) {
  struct Axis {
    std::int64_t cell, step, left;
    double next = 0, delta = 0;  // in shares of the segment
    Axis(double start, double end)
        : cell(static_cast<std::int64_t>(std::floor(start))), step(end < start ? -1 : 1) {
      left = step * (static_cast<std::int64_t>(std::floor(end)) - cell);
      if (left == 0) return;
      delta = 1.0 / std::abs(end - start);
      next = delta * std::abs(static_cast<double>(cell + (step > 0)) - start);
    }
    void advance() {
      cell += step;
      --left;
      next += delta;
    }
  };
  Axis x(from.x_m, to.x_m);
  Axis y(from.y_m, to.y_m);
  while (x.left + y.left > 0) {
    visit(x.cell, y.cell, false);
    // Counting the steps left, not comparing with the end, so that rounding cannot overshoot it.
    const bool along_x = y.left == 0 || (x.left > 0 && x.next < y.next);
    (along_x ? x : y).advance();
  }
  visit(x.cell, y.cell, true);
}

}  // namespace apgm::samples
