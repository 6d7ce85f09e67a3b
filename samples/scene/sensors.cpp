#include "scene/sensors.hpp"

#include <algorithm>

#include "apgm/core/portable_math.hpp"

namespace apgm::samples {
namespace {

constexpr double kPi = 3.141592653589793;

Point direction(double angle_rad) { return {portable::cos(angle_rad), portable::sin(angle_rad)}; }

/// Poses every `step_m` along a polyline, headed along the chord of the 3 m around them.
std::vector<Pose> follow(const std::vector<Point>& corners, double step_m) {
  std::vector<double> reached{0};
  for (std::size_t i = 1; i < corners.size(); ++i) {
    reached.push_back(reached.back() + length(corners[i] - corners[i - 1]));
  }
  const auto at = [&](double s) {
    std::size_t i = 1;
    while (i + 1 < corners.size() && reached[i] < s) ++i;
    const double share = std::clamp((s - reached[i - 1]) / (reached[i] - reached[i - 1]), 0.0, 1.0);
    return corners[i - 1] + share * (corners[i] - corners[i - 1]);
  };
  std::vector<Pose> poses;
  const int count = static_cast<int>(reached.back() / step_m);
  for (int k = 0; k <= count; ++k) {
    const double s = k * step_m;
    poses.push_back({at(s), unit(at(s + 1.5) - at(s - 1.5))});
  }
  return poses;
}

}  // namespace

Drive drive_a() {
  return {follow({{24, 45.5},
                  {94, 45.5},
                  {98, 44},
                  {99.5, 40},
                  {99.5, 33},
                  {97, 29.5},
                  {92, 28.5},
                  {60, 28.5},
                  {57, 27},
                  {56, 23},
                  {56, 15},
                  {58, 11},
                  {63, 10},
                  {112, 10}},
                 2.5)};
}

Drive drive_b() { return {follow({{116, 13.8}, {6, 13.8}}, 2.5), 60'000'000'000}; }

Lidar front_left_lidar() { return {.mount_m = {2.0, 0.8}, .yaw_rad = kPi / 4, .fov_rad = kPi * 1.5}; }

Lidar rear_right_lidar() { return {.mount_m = {-2.0, -0.8}, .yaw_rad = -kPi * 0.75, .fov_rad = kPi * 1.5}; }

LidarScan measure(const Scene& scene, const Pose& pose, const Lidar& lidar, Random& random) {
  LidarScan scan;
  scan.origin = pose.position + turned(lidar.mount_m, pose.heading);
  scan.max_range_m = lidar.max_range_m;
  const Point forward = turned(direction(lidar.yaw_rad), pose.heading);
  const double spacing_rad = lidar.fov_rad / lidar.beams;
  // The phase moves from scan to scan: otherwise beams of a straight drive leave the same gaps.
  const double first_rad = -lidar.fov_rad / 2 + spacing_rad * random.uniform();
  for (int i = 0; i < lidar.beams; ++i) {
    const Point along = turned(direction(first_rad + i * spacing_rad), forward);
    const auto hit = scene.cast(scan.origin, along, lidar.max_range_m);
    const double noise = lidar.noise_m * random.bell();
    const double range = hit.obstacle ? std::max(0.0, hit.range_m + noise) : hit.range_m;
    scan.beams.push_back({scan.origin + range * along, hit.obstacle});
  }
  return scan;
}

CameraFrame measure(const Scene& scene, const Pose& pose, const Camera& camera, Random& random) {
  CameraFrame frame;
  const Point origin = pose.position + turned(camera.mount_m, pose.heading);
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
      frame.pixels.push_back({ground, wrong ? drawn : scene.ground(ground)});
    }
  }
  return frame;
}

}  // namespace apgm::samples
