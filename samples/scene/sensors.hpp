#pragma once

#include <cstdint>
#include <string>

#include "apgm/observe/measurement.hpp"
#include "scene/drive.hpp"
#include "scene/random.hpp"
#include "scene/scene.hpp"

namespace apgm::samples {

/// A lidar in the plane of the scene: `beams` spread over `fov_rad`, turned a little from scan to scan.
struct Lidar {
  std::string name;
  Point mount_m;  ///< x forward, y to the left of the vehicle's centre
  double yaw_rad = 0;
  double fov_rad = kPi * 1.5;
  int beams = 360;
  double max_range_m = 60;
  double clears_m = 60;   ///< a beam that hits nothing tells that so much of its way is free
  double noise_m = 0.02;  ///< standard deviation of the range
};
Lidar front_left_lidar();
Lidar rear_right_lidar();

/// A beam that hits nothing tells that its whole way is free, to the range of the lidar or the scene's
/// border.
RangeScan measure(const Scene& scene, const VehiclePose& pose, const Lidar& lidar, std::int64_t stamp_ns,
                  Random& random);

/// A front camera whose pixels are projected to the ground: rows lie evenly in 1 / distance.
struct Camera {
  Point mount_m{1.8, 0};
  double fov_rad = kPi / 2;
  double min_range_m = 2;
  double max_range_m = 25;
  int columns = 200;
  int rows = 120;
  double wrong_label = 0.04;  ///< share of pixels whose label is drawn at random
};

/// Ground behind the first obstacle of a column is not seen; the obstacle's foot is labelled Blocked.
LabelledGround measure(const Scene& scene, const VehiclePose& pose, const Camera& camera,
                       std::int64_t stamp_ns, Random& random);

}  // namespace apgm::samples
