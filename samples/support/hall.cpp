#include "support/hall.hpp"

#include <algorithm>
#include <limits>

#include "apgm/core/portable_math.hpp"

namespace apgm::samples {
namespace {

/// How far the wall of an axis is along a beam: that at 0 or that at `end_m`.
double to_wall_m(double from_m, double end_m, double direction) {
  if (direction == 0) return std::numeric_limits<double>::infinity();
  return ((direction > 0 ? end_m : 0) - from_m) / direction;
}

}  // namespace

LaserScan scan_of_the_hall(Point robot, std::int64_t stamp_ns, double first_rad, int beams) {
  constexpr double kPi = 3.141592653589793;
  LaserScan scan;
  scan.stamp_ns = stamp_ns;
  scan.pose = Pose::planar(robot.x_m, robot.y_m, 0);
  scan.angle_min_rad = first_rad;
  scan.angle_step_rad = kPi / 360;
  scan.max_range_m = 30;
  for (int i = 0; i < beams; ++i) {
    const double angle = scan.angle_min_rad + i * scan.angle_step_rad;
    const double to_x = to_wall_m(robot.x_m, 60, portable::cos(angle));
    const double to_y = to_wall_m(robot.y_m, 20, portable::sin(angle));
    scan.ranges_m.push_back(static_cast<float>(std::min({to_x, to_y, scan.max_range_m})));
  }
  return scan;
}

}  // namespace apgm::samples
