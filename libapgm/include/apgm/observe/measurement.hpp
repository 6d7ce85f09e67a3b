#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "apgm/core/frame.hpp"

namespace apgm {

/// T_map_sensor: takes sensor coordinates to those of the map.
struct Pose {
  std::array<double, 9> rotation{1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< row-major, orthonormal, det +1
  std::array<double, 3> translation_m{};

  /// In the plane: turned by `yaw_rad` from x towards y, |yaw_rad| <= 1e5 (beyond, check() refuses it). Same
  /// bits on every machine.
  static Pose planar(double x_m, double y_m, double yaw_rad);
  /// @throws Error{kInvalidArgument} unless finite and of a length within 1e-3 of 1 (it is normalised)
  static Pose from_quaternion(std::array<double, 3> translation_m, double w, double x, double y, double z);
  /// @throws Error{kInvalidArgument} unless finite and orthonormal within 1e-3 with determinant +1
  void check() const;

  std::array<double, 3> apply(std::array<double, 3> p) const;
  Point position() const { return {translation_m[0], translation_m[1]}; }
  friend bool operator==(const Pose&, const Pose&) = default;
};

/// Readings of a planar range finder: beam i points to angle_min_rad + i * angle_step_rad.
struct LaserScan {
  std::string source = "laser";  ///< name of the sensor
  std::int64_t stamp_ns = 0;
  Pose pose;  ///< of the sensor
  double angle_min_rad = 0;
  double angle_step_rad = 0;
  double max_range_m = 0;  ///< readings at or beyond it mean no return; 0: not said
  std::vector<float> ranges_m;
};

/// Points of a three-dimensional range sensor, in its own coordinates: x, y, z one after the other.
struct PointCloud {
  std::string source = "lidar";
  std::int64_t stamp_ns = 0;
  Pose pose;  ///< of the sensor
  std::vector<float> xyz_m;
};

/// What a range sensor tells of the plane of the map: the common form of laser scans and point clouds.
/// All points are metres of the map's CRS.
struct RangeScan {
  std::string source;
  std::int64_t stamp_ns = 0;
  Point origin;  ///< of the sensor
  struct Beam {
    Point from;        ///< where the beam enters the heights the layer stands for
    Point to;          ///< the return, or where the beam leaves these heights
    bool hit = false;  ///< `to` is a return within these heights
    friend bool operator==(const Beam&, const Beam&) = default;
  };
  std::vector<Beam> beams;
};

/// Pixels of a camera image with a class each, projected to the ground.
struct LabelledGround {
  std::string source = "camera";
  std::int64_t stamp_ns = 0;
  Point origin;  ///< of the camera
  struct Pixel {
    Point ground;            ///< metres of the map's CRS
    std::uint8_t label = 0;  ///< position of the class among the hypotheses of the layer type
  };
  std::vector<Pixel> pixels;
};

/// Readings that were not used, by reason.
struct Skipped {
  std::uint64_t not_a_number = 0;
  std::uint64_t too_near = 0;
  std::uint64_t no_return = 0;  ///< at or beyond the maximum range
  /// Coordinates beyond the map's limits, unknown labels, returns whose beam runs outside the heights all the
  /// way.
  std::uint64_t outside = 0;
  Skipped& operator+=(const Skipped& o);
  std::uint64_t total() const { return not_a_number + too_near + no_return + outside; }
};

/// What of a sensor's readings is used.
struct RangeLimits {
  double min_range_m = 0.1;  ///< nearer readings are the vehicle itself; 0 never is a return
  double max_range_m = 80;   ///< longer ones mean no return; a scan's own maximum counts where it is less
  /// A beam without return clears the way this far; 0: tells nothing. Dark or slanted surfaces give no return
  /// either, so that a beam said to be free may run through a wall.
  double no_return_clears_m = 0;
  double z_min_m = -1e4;  ///< heights of the map, [z_min, z_max), that the layer stands for
  double z_max_m = 1e4;
};

/// Heights are not looked at: a planar range finder measures at the height its layer stands for. -inf is too
/// near, +inf no return.
/// @param skipped  is added to
/// @throws Error{kInvalidArgument} as Pose::check, or if an angle is not finite
RangeScan to_range_scan(const LaserScan& scan, const RangeLimits& limits, Skipped& skipped);
/// A return within the heights is a hit. Beams count as free only where they run inside the heights: a beam
/// that ends on the ground below z_min clears its way down to z_min and no further. Points with a coordinate
/// that is not finite count as not_a_number.
/// @throws Error{kInvalidArgument} as Pose::check, or if the numbers are no multiple of three
RangeScan to_range_scan(const PointCloud& cloud, const RangeLimits& limits, Skipped& skipped);

}  // namespace apgm
