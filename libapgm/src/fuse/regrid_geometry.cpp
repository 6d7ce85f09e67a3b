#include "fuse/regrid_geometry.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "apgm/core/error.hpp"
#include "apgm/core/portable_math.hpp"

namespace apgm::fuse {
namespace {

constexpr std::int64_t kNanoPerMicro = 1000;
/// Cells of all steps are whole numbers of 2^-11 nanometres.
constexpr std::int64_t kPartsPerNano = std::int64_t{1} << kMaxStep;

std::int64_t shift_nm(double metres) {
  if (!std::isfinite(metres))
    throw Error(ErrorCode::kInvalidArgument, "a shift or pivot is not a finite number");
  if (std::fabs(metres) > 2e9) throw Error(ErrorCode::kLimit, "a shift or pivot lies beyond 2e9 m");
  return std::llrint(metres * 1e9);
}

std::int64_t floor_cell(double v) {
  const double limit = 1e15;
  return static_cast<std::int64_t>(std::floor(std::clamp(v, -limit, limit)));
}

[[noreturn]] void fail_outside() {
  throw Error(ErrorCode::kLimit, "a patch lies outside all patch indices of the target frame");
}

std::int64_t floor_wide(__int128 value, std::int64_t divisor) {
  __int128 q = value / divisor;
  if (value % divisor != 0 && value < 0) --q;
  if (q > std::numeric_limits<std::int32_t>::max() || q < std::numeric_limits<std::int32_t>::min())
    fail_outside();
  return static_cast<std::int64_t>(q);
}

}  // namespace

FrameMapping::FrameMapping(const Frame& source, const Frame& target, const RigidMotion& motion)
    : source_edge_nm_(source.edge_um * kNanoPerMicro),
      target_edge_nm_(target.edge_um * kNanoPerMicro),
      aligned_(motion.yaw_rad == 0) {
  source.check();
  target.check();
  if (!(std::fabs(motion.yaw_rad) <= 1e3)) {
    throw Error(ErrorCode::kInvalidArgument, "a yaw must be a number of radians within 1000");
  }
  const std::int64_t shift_x = shift_nm(motion.shift_m.x_m), shift_y = shift_nm(motion.shift_m.y_m);
  const std::int64_t pivot_x = shift_nm(motion.pivot_m.x_m), pivot_y = shift_nm(motion.pivot_m.y_m);
  // Datums lie within 1e18 nm, shifts and pivots within 2e18: sums of three of them stay below 2^63.
  from_pivot_x_nm_ = source.datum_x_um * kNanoPerMicro - pivot_x;
  from_pivot_y_nm_ = source.datum_y_um * kNanoPerMicro - pivot_y;
  pivot_x_nm_ = pivot_x + shift_x - target.datum_x_um * kNanoPerMicro;
  pivot_y_nm_ = pivot_y + shift_y - target.datum_y_um * kNanoPerMicro;
  apart_x_nm_ = (source.datum_x_um - target.datum_x_um) * kNanoPerMicro + shift_x;
  apart_y_nm_ = (source.datum_y_um - target.datum_y_um) * kNanoPerMicro + shift_y;
  cos_ = portable::cos(motion.yaw_rad);
  sin_ = portable::sin(motion.yaw_rad);
}

void FrameMapping::targets_of(PatchIndex source, std::size_t limit, std::vector<PatchIndex>& out) const {
  out.clear();
  Reach rx, ry;
  Quad q{};
  if (aligned_) {
    const auto along = [&](std::int64_t apart_nm, std::int64_t index) {
      const __int128 low = static_cast<__int128>(index) * source_edge_nm_ + apart_nm;
      return Reach{floor_wide(low, target_edge_nm_), floor_wide(low + source_edge_nm_ - 1, target_edge_nm_)};
    };
    rx = along(apart_x_nm_, source.x);
    ry = along(apart_y_nm_, source.y);
  } else {
    q = quad(source);
    rx = reach(q[0].x, q[1].x, q[2].x, q[3].x);
    ry = reach(q[0].y, q[1].y, q[2].y, q[3].y);
    constexpr std::int64_t kMin = std::numeric_limits<std::int32_t>::min();
    constexpr std::int64_t kMax = std::numeric_limits<std::int32_t>::max();
    if (rx.min < kMin || ry.min < kMin || rx.max > kMax || ry.max > kMax) fail_outside();
  }
  // Each factor is below 2^33.
  const auto wide = static_cast<__int128>(rx.max - rx.min + 1) * (ry.max - ry.min + 1);
  if (wide > static_cast<__int128>(limit)) {
    throw Error(ErrorCode::kLimit, "the target frame has too many patches")
        .hint("choose a larger patch edge");
  }
  const double least = 1e-12;
  for (std::int64_t y = ry.min; y <= ry.max; ++y) {
    for (std::int64_t x = rx.min; x <= rx.max; ++x) {
      if (!aligned_ && shared_area(q, static_cast<double>(x), static_cast<double>(y)) <= least) continue;
      out.push_back({static_cast<std::int32_t>(x), static_cast<std::int32_t>(y)});
    }
  }
}

std::int64_t FrameMapping::offset_nm(std::int64_t apart_nm, std::int64_t source, std::int64_t target) const {
  const __int128 offset = static_cast<__int128>(source) * source_edge_nm_ + apart_nm -
                          static_cast<__int128>(target) * target_edge_nm_;
  // Patches that share no area may be any distance apart: all such are alike.
  const __int128 far = static_cast<__int128>(source_edge_nm_) + target_edge_nm_;
  return static_cast<std::int64_t>(std::clamp<__int128>(offset, -far, far));
}

std::vector<FrameMapping::Span> FrameMapping::spans(std::int64_t offset_nm, int source_step,
                                                    int target_step) const {
  // At most 2e13 nm * 2^11 = 4e16.
  const std::int64_t source_cell = (source_edge_nm_ * kPartsPerNano) >> source_step;
  const std::int64_t target_cell = (target_edge_nm_ * kPartsPerNano) >> target_step;
  const std::int64_t last = (std::int64_t{1} << target_step) - 1;
  std::vector<Span> out;
  for (std::int64_t a = 0; a < (std::int64_t{1} << source_step); ++a) {
    const std::int64_t low = offset_nm * kPartsPerNano + a * source_cell;
    const std::int64_t high = low + source_cell;
    const std::int64_t from = std::max<std::int64_t>(floor_div(low, target_cell), 0);
    const std::int64_t to = std::min(floor_div(high - 1, target_cell), last);
    for (std::int64_t t = from; t <= to; ++t) {
      const double shared =
          static_cast<double>(std::min(high, (t + 1) * target_cell) - std::max(low, t * target_cell));
      out.push_back({static_cast<std::size_t>(a), static_cast<std::size_t>(t),
                     shared / static_cast<double>(source_cell), shared / static_cast<double>(target_cell)});
    }
  }
  return out;
}

FrameMapping::Vec FrameMapping::corner(std::int64_t ix, std::int64_t iy) const {
  const double x = static_cast<double>(static_cast<__int128>(ix) * source_edge_nm_ + from_pivot_x_nm_);
  const double y = static_cast<double>(static_cast<__int128>(iy) * source_edge_nm_ + from_pivot_y_nm_);
  const double edge = static_cast<double>(target_edge_nm_);
  return {(cos_ * x - sin_ * y + static_cast<double>(pivot_x_nm_)) / edge,
          (sin_ * x + cos_ * y + static_cast<double>(pivot_y_nm_)) / edge};
}

FrameMapping::Quad FrameMapping::quad(PatchIndex source) const {
  const std::int64_t x = source.x, y = source.y;
  return {corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)};
}

FrameMapping::Reach FrameMapping::reach(double a, double b, double c, double d) {
  return {floor_cell(std::min(std::min(a, b), std::min(c, d))),
          floor_cell(std::max(std::max(a, b), std::max(c, d)))};
}

double FrameMapping::shared_area(const Quad& quad, double x0, double y0) {
  // Sutherland and Hodgman's clipping of a convex polygon by the four sides of a unit square, in coordinates
  // from its corner. Each side adds at most one corner.
  std::array<Vec, 8> polygon;
  std::array<Vec, 8> clipped;
  std::size_t count = 4;
  for (std::size_t i = 0; i < 4; ++i) polygon[i] = {quad[i].x - x0, quad[i].y - y0};
  for (int side = 0; side < 4; ++side) {
    const auto inner = [side](Vec p) {
      const double along = side < 2 ? p.x : p.y;
      return side % 2 == 0 ? along : 1 - along;
    };
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const Vec p = polygon[i], q = polygon[i + 1 == count ? 0 : i + 1];
      const double dp = inner(p), dq = inner(q);
      if (dp >= 0 && kept < clipped.size()) clipped[kept++] = p;
      if ((dp >= 0) != (dq >= 0) && kept < clipped.size()) {
        const double t = dp / (dp - dq);
        clipped[kept++] = {p.x + t * (q.x - p.x), p.y + t * (q.y - p.y)};
      }
    }
    polygon = clipped;
    count = kept;
  }
  double twice = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec p = polygon[i], q = polygon[i + 1 == count ? 0 : i + 1];
    twice += p.x * q.y - q.x * p.y;
  }
  return 0.5 * std::fabs(twice);
}

}  // namespace apgm::fuse
