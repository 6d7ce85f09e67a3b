#include "apgm/observe/measurement.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "apgm/core/error.hpp"
#include "apgm/core/portable_math.hpp"

namespace apgm {
namespace {

using Vector = std::array<double, 3>;

double dot(const double* a, const double* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

bool is_rotation(const std::array<double, 9>& r) {
  constexpr double kSlack = 1e-3;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const double wanted = i == j ? 1 : 0;
      if (!(std::fabs(dot(&r[3 * i], &r[3 * j]) - wanted) <= kSlack)) return false;
    }
  }
  const double determinant = r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) +
                             r[2] * (r[3] * r[7] - r[4] * r[6]);
  return determinant > 0;
}

enum class Reading { kReturn, kNoReturn, kUnused };

/// What a reading of `range_m` means; counts it if it is no return.
Reading sort_reading(double range_m, double min_m, double max_m, Skipped& skipped) {
  if (std::isnan(range_m)) {
    ++skipped.not_a_number;
    return Reading::kUnused;
  }
  if (range_m < min_m || range_m == 0) {  // drivers write 0 where they measured nothing
    ++skipped.too_near;
    return Reading::kUnused;
  }
  if (range_m < max_m) return Reading::kReturn;
  ++skipped.no_return;
  return Reading::kNoReturn;
}

RangeScan begin_scan(const std::string& source, std::int64_t stamp_ns, const Pose& pose,
                     std::size_t readings) {
  pose.check();
  RangeScan scan;
  scan.source = source;
  scan.stamp_ns = stamp_ns;
  scan.origin = pose.position();
  scan.beams.reserve(readings);
  return scan;
}

/// The part of a beam within [z_min, z_max).
class Heights {
 public:
  explicit Heights(const RangeLimits& limits) : min_(limits.z_min_m), max_(limits.z_max_m) {}

  bool hold(double z) const { return z >= min_ && z < max_; }
  /// Shares of the way from `z0` to `z1` that lie within; false if none.
  bool clip(double z0, double z1, double& begin, double& end) const {
    begin = 0;
    end = 1;
    const double rise = z1 - z0;
    if (rise == 0) return hold(z0);
    const double at_min = (min_ - z0) / rise, at_max = (max_ - z0) / rise;
    begin = std::max(begin, std::min(at_min, at_max));
    end = std::min(end, std::max(at_min, at_max));
    return begin < end;
  }

 private:
  double min_, max_;
};

/// Adds the beam from `from` to `to` as far as it runs within the heights.
/// @return false if nothing of it does
bool add_beam(RangeScan& scan, const Vector& from, const Vector& to, bool is_return, const Heights& heights) {
  double begin = 0, end = 1;
  const bool hit = is_return && heights.hold(to[2]);
  if (!heights.clip(from[2], to[2], begin, end)) {
    if (!hit) return false;
    begin = end = 1;  // only its very end lies within
  }
  const auto at = [&](double share) {
    return Point{from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])};
  };
  scan.beams.push_back({begin > 0 ? at(begin) : Point{from[0], from[1]},
                        hit || end >= 1 ? Point{to[0], to[1]} : at(end), hit});
  return true;
}

}  // namespace

Pose Pose::planar(double x_m, double y_m, double yaw_rad) {
  const double c = portable::cos(yaw_rad), s = portable::sin(yaw_rad);
  return {{c, -s, 0, s, c, 0, 0, 0, 1}, {x_m, y_m, 0}};
}

Pose Pose::from_quaternion(std::array<double, 3> translation_m, double w, double x, double y, double z) {
  const double length = std::sqrt(w * w + x * x + y * y + z * z);
  if (!(std::fabs(length - 1) <= 1e-3)) {
    throw Error(ErrorCode::kInvalidArgument, "the quaternion of a pose is not of length 1");
  }
  w /= length, x /= length, y /= length, z /= length;
  Pose pose;
  pose.rotation = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                   2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                   2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  pose.translation_m = translation_m;
  pose.check();
  return pose;
}

void Pose::check() const {
  for (const double t : translation_m) {
    if (!std::isfinite(t)) throw Error(ErrorCode::kInvalidArgument, "the position of a pose is not finite");
  }
  if (!is_rotation(rotation)) {
    throw Error(ErrorCode::kInvalidArgument, "the orientation of a pose is not a rotation")
        .hint("its matrix has rows of length 1 at right angles, and determinant +1");
  }
}

std::array<double, 3> Pose::apply(std::array<double, 3> p) const {
  return {dot(&rotation[0], p.data()) + translation_m[0], dot(&rotation[3], p.data()) + translation_m[1],
          dot(&rotation[6], p.data()) + translation_m[2]};
}

Skipped& Skipped::operator+=(const Skipped& o) {
  not_a_number += o.not_a_number;
  too_near += o.too_near;
  no_return += o.no_return;
  outside += o.outside;
  return *this;
}

RangeScan to_range_scan(const LaserScan& scan, const RangeLimits& limits, Skipped& skipped) {
  RangeScan out = begin_scan(scan.source, scan.stamp_ns, scan.pose, scan.ranges_m.size());
  if (!std::isfinite(scan.angle_min_rad) || !std::isfinite(scan.angle_step_rad)) {
    throw Error(ErrorCode::kInvalidArgument, "the angles of a scan are not finite numbers");
  }
  double max_m = limits.max_range_m;
  if (scan.max_range_m > 0) max_m = std::min(max_m, scan.max_range_m);
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
    double range_m = scan.ranges_m[i];
    const Reading reading = sort_reading(range_m, limits.min_range_m, max_m, skipped);
    if (reading == Reading::kUnused) continue;
    if (reading == Reading::kNoReturn) {
      if (limits.no_return_clears_m == 0) continue;
      range_m = std::min(limits.no_return_clears_m, max_m);
    }
    const double angle = scan.angle_min_rad + static_cast<double>(i) * scan.angle_step_rad;
    const Vector end = scan.pose.apply({range_m * portable::cos(angle), range_m * portable::sin(angle), 0});
    out.beams.push_back({out.origin, {end[0], end[1]}, reading == Reading::kReturn});
  }
  return out;
}

RangeScan to_range_scan(const PointCloud& cloud, const RangeLimits& limits, Skipped& skipped) {
  if (cloud.xyz_m.size() % 3 != 0) {
    throw Error(ErrorCode::kInvalidArgument, "a point cloud does not hold three numbers a point");
  }
  RangeScan out = begin_scan(cloud.source, cloud.stamp_ns, cloud.pose, cloud.xyz_m.size() / 3);
  const Heights heights(limits);
  for (std::size_t i = 0; i + 2 < cloud.xyz_m.size(); i += 3) {
    Vector p{cloud.xyz_m[i], cloud.xyz_m[i + 1], cloud.xyz_m[i + 2]};
    // Squares of float32 do not overflow: an infinite length means an infinite coordinate, without direction.
    double range_m = std::sqrt(dot(p.data(), p.data()));
    if (std::isinf(range_m)) range_m = std::numeric_limits<double>::quiet_NaN();
    const Reading reading = sort_reading(range_m, limits.min_range_m, limits.max_range_m, skipped);
    if (reading == Reading::kUnused) continue;
    if (reading == Reading::kNoReturn) {
      if (limits.no_return_clears_m == 0) continue;
      const double clears_m = std::min(limits.no_return_clears_m, limits.max_range_m);
      for (double& c : p) c *= clears_m / range_m;
    }
    const bool is_return = reading == Reading::kReturn;
    if (!add_beam(out, cloud.pose.translation_m, cloud.pose.apply(p), is_return, heights) && is_return) {
      ++skipped.outside;
    }
  }
  return out;
}

}  // namespace apgm
