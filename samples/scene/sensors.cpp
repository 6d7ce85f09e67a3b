#include "scene/sensors.hpp"

#include <algorithm>

namespace apgm::samples {

Lidar front_left_lidar() { return {.name = "front-left lidar", .mount_m = {2.0, 0.8}, .yaw_rad = kPi / 4}; }

Lidar rear_right_lidar() {
  return {.name = "rear-right lidar", .mount_m = {-2.0, -0.8}, .yaw_rad = -kPi * 0.75};
}

RangeScan measure(const Scene& scene, const VehiclePose& pose, const Lidar& lidar, std::int64_t stamp_ns,
                  Random& random) {
  const Point origin = pose.position + turned(lidar.mount_m, pose.heading);
  RangeScan scan{lidar.name, stamp_ns, scene.in_map(origin), {}};
  scan.beams.reserve(static_cast<std::size_t>(lidar.beams));
  const Point forward = turned(direction(lidar.yaw_rad), pose.heading);
  const double spacing_rad = lidar.fov_rad / lidar.beams;
  // The phase moves from scan to scan: otherwise beams of a straight drive leave the same gaps.
  const double first_rad = -lidar.fov_rad / 2 + spacing_rad * random.uniform();
  for (int i = 0; i < lidar.beams; ++i) {
    const Point along = turned(direction(first_rad + i * spacing_rad), forward);
    const auto hit = scene.cast(origin, along, lidar.max_range_m);
    const double noise = lidar.noise_m * random.bell();
    const double range =
        hit.obstacle ? std::max(0.0, hit.range_m + noise) : std::min(hit.range_m, lidar.clears_m);
    scan.beams.push_back({scan.origin, scene.in_map(origin + range * along), hit.obstacle});
  }
  return scan;
}

LabelledGround measure(const Scene& scene, const VehiclePose& pose, const Camera& camera,
                       std::int64_t stamp_ns, Random& random) {
  const Point origin = pose.position + turned(camera.mount_m, pose.heading);
  LabelledGround image{"camera", stamp_ns, scene.in_map(origin), {}};
  const double near = 1 / camera.min_range_m;
  const double step = (near - 1 / camera.max_range_m) / camera.rows;
  for (int c = 0; c < camera.columns; ++c) {
    const double angle = camera.fov_rad * ((c + 0.5) / camera.columns - 0.5);
    const Point along = turned(direction(angle), pose.heading);
    const auto hit = scene.cast(origin, along, camera.max_range_m);
    for (int r = 0; r < camera.rows; ++r) {
      const double range = 1 / (near - (r + random.uniform()) * step);
      const bool wrong = random.uniform() < camera.wrong_label;
      const auto drawn = static_cast<Ground>(static_cast<int>(3 * random.uniform()));
      // The foot of an obstacle is as deep as one cell of the camera's layer.
      if (range > hit.range_m + (hit.obstacle ? 0.2 : 0.0)) break;
      const Point ground = origin + range * along;
      const Ground label = wrong ? drawn : scene.ground(ground);
      image.pixels.push_back({scene.in_map(ground), static_cast<std::uint8_t>(label)});
    }
  }
  return image;
}

}  // namespace apgm::samples
