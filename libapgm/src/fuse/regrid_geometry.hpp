#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "apgm/core/frame.hpp"
#include "apgm/fuse/regrid.hpp"

namespace apgm::fuse {

/// A source cell and a target cell that share area.
struct Overlap {
  std::size_t source = 0;  ///< cell number in its layer, b * 2^r + a
  std::size_t target = 0;
  double of_source = 0;  ///< shared area / area of the source cell
  double of_target = 0;  ///< shared area / area of the target cell
};

/// A patch and the step of a layer in it.
struct Grid {
  PatchIndex patch;
  int step = 0;
};

/// Where the patches and cells of one frame lie in another. Without yaw all of it is exact: lengths are whole
/// numbers of 1/2048 nanometres. With yaw overlaps below 1e-9 of the smaller cell are dropped.
class FrameMapping {
 public:
  /// @throws Error{kInvalidArgument|kLimit} if the frame or the motion cannot be used
  FrameMapping(const Frame& source, const Frame& target, const RigidMotion& motion);

  /// Target patches that share area with a source patch. At most `limit` are tried.
  /// @throws Error{kLimit} if there may be more, or some lie outside all indices
  void targets_of(PatchIndex source, std::size_t limit, std::vector<PatchIndex>& out) const;

  /// The overlaps of two layers, row by row of source cells. `wants(source)` is asked before the work on a
  /// cell is done.
  template <class Wants, class Visit>
  void visit(Grid source, Grid target, Wants&& wants, Visit&& visit) const {
    if (aligned_) {
      visit_aligned(source, target, wants, visit);
    } else {
      visit_rotated(source, target, wants, visit);
    }
  }

 private:
  struct Vec {
    double x = 0;
    double y = 0;
  };
  using Quad = std::array<Vec, 4>;
  /// Overlap on one axis.
  struct Span {
    std::size_t source = 0;
    std::size_t target = 0;
    double of_source = 0;
    double of_target = 0;
  };
  struct Reach {
    std::int64_t min = 0;
    std::int64_t max = -1;
  };

  std::vector<Span> spans(std::int64_t offset_nm, int source_step, int target_step) const;
  /// Lower-left corner of a source patch from that of a target patch, along an axis. Without yaw.
  std::int64_t offset_nm(std::int64_t apart_nm, std::int64_t source, std::int64_t target) const;
  /// A corner of a source patch in the target's frame, from its datum, in target edges.
  Vec corner(std::int64_t ix, std::int64_t iy) const;
  Quad quad(PatchIndex source) const;
  static double shared_area(const Quad& quad, double x0, double y0);
  static Reach reach(double a, double b, double c, double d);

  template <class Wants, class Visit>
  void visit_aligned(Grid source, Grid target, Wants&& wants, Visit&& visit) const {
    const auto xs = spans(offset_nm(apart_x_nm_, source.patch.x, target.patch.x), source.step, target.step);
    const auto ys = spans(offset_nm(apart_y_nm_, source.patch.y, target.patch.y), source.step, target.step);
    for (const Span& y : ys) {
      for (const Span& x : xs) {
        const std::size_t cell = (y.source << source.step) + x.source;
        if (!wants(cell)) continue;
        visit(Overlap{cell, (y.target << target.step) + x.target, x.of_source * y.of_source,
                      x.of_target * y.of_target});
      }
    }
  }

  template <class Wants, class Visit>
  void visit_rotated(Grid source, Grid target, Wants&& wants, Visit&& visit) const;

  std::int64_t source_edge_nm_;
  std::int64_t target_edge_nm_;
  bool aligned_;
  std::int64_t apart_x_nm_ = 0;  // source datum (moved) from target datum; without yaw
  std::int64_t apart_y_nm_ = 0;
  double cos_ = 1;
  double sin_ = 0;
  std::int64_t from_pivot_x_nm_ = 0;  // source datum from the pivot
  std::int64_t from_pivot_y_nm_ = 0;
  std::int64_t pivot_x_nm_ = 0;  // moved pivot from target datum
  std::int64_t pivot_y_nm_ = 0;
};

template <class Wants, class Visit>
void FrameMapping::visit_rotated(Grid source, Grid target, Wants&& wants, Visit&& visit) const {
  const auto target_side = std::int64_t{1} << target.step;
  const std::size_t source_side = std::size_t{1} << source.step;
  // In target cells from the corner of the target patch.
  const double cells = static_cast<double>(target_side);
  const Quad patch = quad(source.patch);
  const auto local = [&](Vec v) {
    return Vec{(v.x - target.patch.x) * cells, (v.y - target.patch.y) * cells};
  };
  const Vec o = local(patch[0]), px = local(patch[1]), py = local(patch[3]);
  const double parts = static_cast<double>(source_side);
  const Vec u{(px.x - o.x) / parts, (px.y - o.y) / parts};
  const Vec v{(py.x - o.x) / parts, (py.y - o.y) / parts};
  const double edges = static_cast<double>(source_edge_nm_) / static_cast<double>(target_edge_nm_);
  const double source_area = (edges * cells / parts) * (edges * cells / parts);
  const double least = 1e-9 * (source_area < 1 ? source_area : 1);
  const auto snap = [](double share) { return share > 1 - 1e-9 ? 1.0 : share; };

  for (std::size_t b = 0; b < source_side; ++b) {
    for (std::size_t a = 0; a < source_side; ++a) {
      const double da = static_cast<double>(a), db = static_cast<double>(b);
      const Vec p{o.x + da * u.x + db * v.x, o.y + da * u.y + db * v.y};
      const Quad q{p, Vec{p.x + u.x, p.y + u.y}, Vec{p.x + u.x + v.x, p.y + u.y + v.y},
                   Vec{p.x + v.x, p.y + v.y}};
      Reach rx = reach(q[0].x, q[1].x, q[2].x, q[3].x);
      Reach ry = reach(q[0].y, q[1].y, q[2].y, q[3].y);
      const bool inside = rx.min == rx.max && ry.min == ry.max;
      rx = {rx.min > 0 ? rx.min : 0, rx.max < target_side ? rx.max : target_side - 1};
      ry = {ry.min > 0 ? ry.min : 0, ry.max < target_side ? ry.max : target_side - 1};
      const std::size_t cell = (b << source.step) + a;
      if (rx.max < rx.min || ry.max < ry.min || !wants(cell)) continue;
      for (std::int64_t y = ry.min; y <= ry.max; ++y) {
        for (std::int64_t x = rx.min; x <= rx.max; ++x) {
          const double area =
              inside ? source_area : shared_area(q, static_cast<double>(x), static_cast<double>(y));
          if (!(area > least)) continue;
          visit(Overlap{cell, static_cast<std::size_t>((y << target.step) + x), snap(area / source_area),
                        snap(area)});
        }
      }
    }
  }
}

}  // namespace apgm::fuse
