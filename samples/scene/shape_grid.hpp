#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "scene/geometry.hpp"

namespace apgm::samples {

/// Finds shapes by place: a uniform grid of squares over a box, each with the ids of the shapes that may lie
/// in it, so that a ray asks only the shapes along its way.
class ShapeGrid {
 public:
  explicit ShapeGrid(const Box& bounds);

  /// Notes `id` where `box` lies; what is outside the bounds is not found.
  void add(const Box& box, std::uint32_t id);
  /// Ids of the square that holds `p`; none outside the bounds.
  std::span<const std::uint32_t> at(Point p) const;

  /// Visits the squares a ray from inside the bounds meets, in order, up to the border or until `visit` says
  /// false: visit(ids, where the ray leaves the square).
  template <class Visit>
  void along(Point origin, Point direction, Visit visit) const {
    Axis x(origin.x_m - bounds_.min.x_m, direction.x_m, columns_);
    Axis y(origin.y_m - bounds_.min.y_m, direction.y_m, rows_);
    while (x.inside() && y.inside()) {
      Axis& first = x.leaves_m < y.leaves_m ? x : y;
      if (!visit(list(x.square, y.square), first.leaves_m)) return;
      first.advance();
    }
  }

 private:
  static constexpr double kSquare_m = 4;

  /// A ray's way through the columns or the rows.
  struct Axis {
    Axis(double origin_m, double direction, int squares);
    bool inside() const { return square >= 0 && square < count; }
    void advance() {
      square += step;
      leaves_m += delta_m;
    }
    int square, count, step = 0;
    double leaves_m = kNoHit, delta_m = 0;
  };

  int column(double x_m) const;
  int row(double y_m) const;
  std::span<const std::uint32_t> list(int column, int row) const {
    return lists_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                  static_cast<std::size_t>(column)];
  }

  Box bounds_;
  int columns_, rows_;
  std::vector<std::vector<std::uint32_t>> lists_;
};

}  // namespace apgm::samples
