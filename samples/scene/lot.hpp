#pragma once

#include <cstdint>

#include "scene/drive.hpp"
#include "scene/scene.hpp"

namespace apgm::samples {

/// A parking lot beside a road, 120 m x 80 m from (0, 0): three rows of bays with parked cars, kerb stones at
/// their ends, an arcade of pillars along a closed building, a road with two lanes and a crossing, poles,
/// trees and a house on the other side. Its corner lies at datum + (-24, -30): the maps hold patches of
/// negative indices, too.
///
/// @param seed  decides which bays are taken and how cars stand in them
Scene lot_scene(std::uint64_t seed = 1);

/// Through the parking lot, round its middle rows, out of the driveway and away to the east.
Drive drive_a();
/// Along the road from east to west, past the lot.
Drive drive_b();

}  // namespace apgm::samples
