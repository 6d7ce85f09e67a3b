#include "scene/shape_grid.hpp"

#include <algorithm>
#include <cmath>

namespace apgm::samples {
namespace {

// Squares a ray enters are found with rounding: shapes are noted this much farther out.
constexpr double kMargin_m = 1e-6;

int squares_over(double extent_m, double square_m) {
  return std::max(1, static_cast<int>(std::ceil(extent_m / square_m)));
}

}  // namespace

ShapeGrid::ShapeGrid(const Box& bounds)
    : bounds_(bounds),
      columns_(squares_over(bounds.max.x_m - bounds.min.x_m, kSquare_m)),
      rows_(squares_over(bounds.max.y_m - bounds.min.y_m, kSquare_m)),
      lists_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_)) {}

int ShapeGrid::column(double x_m) const {
  return static_cast<int>(std::floor((x_m - bounds_.min.x_m) / kSquare_m));
}

int ShapeGrid::row(double y_m) const {
  return static_cast<int>(std::floor((y_m - bounds_.min.y_m) / kSquare_m));
}

void ShapeGrid::add(const Box& box, std::uint32_t id) {
  const int left = std::max(0, column(box.min.x_m - kMargin_m));
  const int right = std::min(columns_ - 1, column(box.max.x_m + kMargin_m));
  const int top = std::min(rows_ - 1, row(box.max.y_m + kMargin_m));
  for (int j = std::max(0, row(box.min.y_m - kMargin_m)); j <= top; ++j) {
    for (int i = left; i <= right; ++i) {
      lists_[static_cast<std::size_t>(j) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(i)]
          .push_back(id);
    }
  }
}

std::span<const std::uint32_t> ShapeGrid::at(Point p) const {
  const int i = column(p.x_m);
  const int j = row(p.y_m);
  if (i < 0 || j < 0 || i >= columns_ || j >= rows_) return {};
  return list(i, j);
}

ShapeGrid::Axis::Axis(double origin_m, double direction, int squares)
    : square(static_cast<int>(std::floor(origin_m / kSquare_m))), count(squares) {
  if (direction == 0) return;
  step = direction > 0 ? 1 : -1;
  delta_m = kSquare_m / std::abs(direction);
  leaves_m = ((square + (step > 0 ? 1 : 0)) * kSquare_m - origin_m) / direction;
}

}  // namespace apgm::samples
