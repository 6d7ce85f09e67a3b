#pragma once

#include <cstdint>
#include <string>

#include "apgm/core/map.hpp"
#include "scene/sensors.hpp"

namespace apgm::samples {

inline constexpr int kLidarStep = 7;   ///< 0.1 m cells
inline constexpr int kCameraStep = 6;  ///< 0.2 m cells
inline constexpr const char* kOccupancy = "occupancy";
inline constexpr const char* kSemantics = "semantics";

/// UTM zone 32 north, datum (570000, 5360000), 12.8 m patches. The scene's corner lies at datum + (-24, -30):
/// the maps hold patches of negative indices, too.
Frame sample_frame();
inline constexpr Point kSceneCorner_m{-24, -30};  ///< from the datum

/// {O, F}; `exclusive` for what one scan tells, `conditional` for fused layers.
LayerType occupancy_type(Policy policy);
/// {Road, Marking, Blocked} + Omega, in the order of Ground.
LayerType semantic_type();

/// One scan as a map: the cell of a hit gets (m, 0) with m falling with the distance from the hit to the
/// cell's centre, a crossed cell (0, m) with m falling linearly with range, nothing behind a hit (after Nuss
/// et al.; docs/theory.md, "Measurement models").
Map occupancy_of(const LidarScan& scan);

/// One frame as a map: every pixel adds lambda_k = -ln(1 - rho) to its label's class; with Lambda their sum,
/// m(Omega) = e^-Lambda and m_k = (lambda_k / Lambda)(1 - e^-Lambda).
Map semantics_of(const CameraFrame& frame);

/// Measurements of one vehicle or sensor, fused over time by Dempster's rule.
class TimeFusion {
 public:
  explicit TimeFusion(MapHeader header) : map_(std::move(header)) {}
  /// Discounts all layers by `alpha`, in (0, 1): what was seen long ago weighs less, and some mass stays on
  /// Omega however often a cell is seen.
  void age(float alpha);
  /// Layer types are matched by name; all must be types of this map.
  void add(const Map& measurement);
  const Map& map() const { return map_; }

 private:
  Map map_;
};

/// What one vehicle makes of its drive.
struct DriveMaps {
  Map vehicle;     ///< both lidars and the camera
  Map front;       ///< front-left lidar alone, fused over time
  Map rear;        ///< rear-right lidar alone, fused over time
  Map first_scan;  ///< one scan of the front-left lidar, policy `exclusive`
};
/// @param name  goes to the maps' metadata
/// @param seed  of the measurement noise
DriveMaps map_drive(const Scene& scene, const Drive& drive, const std::string& name, std::uint64_t seed);

/// The exact scene: (0.98, 0) where a cell's centre lies in an obstacle, (0, 0.98) outside, nothing inside
/// buildings; labels of the ground likewise.
Map truth_map(const Scene& scene);

}  // namespace apgm::samples
