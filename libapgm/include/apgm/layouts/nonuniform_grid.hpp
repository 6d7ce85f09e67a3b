#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "apgm/layouts/layout.hpp"

namespace apgm {

/// A rectangle of equal cells round the vehicle: [x0, x1) x [y0, y1) metres from its snapped position.
struct LayoutRectangle {
  double x0_m = 0, x1_m = 0, y0_m = 0, y1_m = 0;
  double dx_m = 0, dy_m = 0;  ///< sides of a cell
};

/// Non-uniform moving grid (Buerkle et al. 2020) as a list of rectangles, all of them allocated at all times.
struct NonUniformPlan {
  static constexpr std::size_t kMaxRectangles = 256;
  static constexpr std::uint64_t kMaxCells = std::uint64_t{1} << 28;

  std::string name;
  std::vector<LayoutRectangle> rectangles;

  /// Lengths are whole micrometres; rectangles do not overlap, leave no gap in their bounding box, begin and
  /// end at multiples of their cells; sides of cells are the least one times a power of two, at most 2^11.
  /// @throws Error{kInvalidArgument} that names the rectangles, counted from 1; {kLimit} if too large
  void check() const;
  /// Of a plan that passes check().
  std::uint64_t cells() const;
};

/// "A": squares of half extent 20/60/100 m at 0.1/0.2/0.4 m; "B": 3 x 3 blocks, +-20 m at 0.1, edge blocks
/// 0.2, corner blocks 0.4; "C": 0.1 m inside +-20 m, 0.4 m outside, per axis. Each has 640 000 cells. Some of
/// C's cells are not square. @throws Error{kInvalidArgument} for another name
NonUniformPlan buerkle_preset(std::string_view name);

/// A plan from YAML (docs/layouts.md): `name` and `rectangles`, each with `x_m`, `y_m` and `cell_m`.
/// @param name  of the text, for messages
/// @throws Error{kInvalidArgument} with the line on anything unknown or missing; those of check()
NonUniformPlan parse_plan(std::string_view yaml, std::string_view name);

/// Each rectangle is a ring buffer. Starts round the datum; the vehicle's position is taken to the nearest
/// multiple of the coarsest side. Moving keeps the bits of cells that stay in their rectangle; those that
/// enter are gathered by area from the cells that lay there (docs/theory.md, "Arbitrary ratio or offset"), so
/// they agree with resample() to float32 rounding; kMedian and kDempster move as kConditional.
/// @throws those of NonUniformPlan::check; {kLimit} if the cells would take more than 8 GiB
std::unique_ptr<Layout> make_nonuniform_grid(CellSchema schema, const Frame& frame, NonUniformPlan plan);

}  // namespace apgm
