#pragma once

#include <cstdint>
#include <string>

#include "apgm/core/map.hpp"
#include "apgm/observe/model.hpp"
#include "scene/drive.hpp"
#include "scene/scene.hpp"

namespace apgm::samples {

/// What the vehicles of make-scene carry: `occupancy` after Nuss to 60 m, `semantics` {Road, Marking,
/// Blocked} to 25 m.
Models lot_models();

/// What one vehicle makes of its drive: `occupancy` at 0.1 m, `semantics` at 0.2 m, over the whole scene.
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
