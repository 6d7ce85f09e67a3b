#pragma once

#include <cstdint>
#include <vector>

#include "scene/random.hpp"
#include "scene/scene.hpp"

namespace apgm::samples {

/// Where a vehicle stands, in scene metres, and a unit vector along its nose.
struct Pose {
  Point position;
  Point heading{1, 0};
};

/// A vehicle on its way through the scene: one pose for each measurement.
struct Drive {
  std::vector<Pose> poses;
  std::int64_t start_ns = 0;
  std::int64_t period_ns = 250'000'000;
};
/// Through the parking lot, round its middle rows, out of the driveway and away to the east.
Drive drive_a();
/// Along the road from east to west, past the lot.
Drive drive_b();

/// A lidar in the plane of the scene: `beams` spread over `fov_rad`, turned a little from scan to scan.
struct Lidar {
  Point mount_m;  ///< x forward, y to the left of the vehicle's centre
  double yaw_rad = 0;
  double fov_rad = 0;
  int beams = 360;
  double max_range_m = 60;
  double noise_m = 0.02;  ///< standard deviation of the range
};
Lidar front_left_lidar();
Lidar rear_right_lidar();

struct LidarScan {
  struct Beam {
    Point end;              ///< scene metres, with noise
    bool obstacle = false;  ///< false: nothing was hit on the way to `end`
  };
  Point origin;
  double max_range_m = 0;
  std::vector<Beam> beams;
  std::int64_t stamp_ns = 0;
};
LidarScan measure(const Scene& scene, const Pose& pose, const Lidar& lidar, Random& random);

/// A front camera whose pixels are projected to the ground: rows lie evenly in 1 / distance.
struct Camera {
  Point mount_m{1.8, 0};
  double fov_rad = 1.5707963267948966;
  double min_range_m = 2;
  double max_range_m = 25;
  int columns = 200;
  int rows = 120;
  double wrong_label = 0.04;  ///< share of pixels whose label is drawn at random
};

struct CameraFrame {
  struct Pixel {
    Point ground;  ///< scene metres
    Ground label = Ground::kBlocked;
  };
  std::vector<Pixel> pixels;
  std::int64_t stamp_ns = 0;
};
/// Ground behind the first obstacle of a column is not seen; the obstacle's foot is labelled Blocked.
CameraFrame measure(const Scene& scene, const Pose& pose, const Camera& camera, Random& random);

}  // namespace apgm::samples
