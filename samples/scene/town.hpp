#pragma once

#include <cstdint>

#include "scene/drive.hpp"
#include "scene/scene.hpp"

namespace apgm::samples {

/// A town of 1700 m x 510 m: car park A in the west, a road of 1.5 km with four bends, car park B in the
/// east. Houses stand close to both sides of the road, with gaps that open on yards; side streets, parked
/// cars, trees, poles, zebra crossings, lane markings. Its origin lies at datum + (-300, -200).
///
/// @param seed  of houses, cars and everything else but road and car parks
Scene town_scene(std::uint64_t seed = 1);

/// The middle line of the town's road, from west to east.
Track town_road();

/// The course of the paper's drive (Sec. V-A): 465 s, out of car park A, on the road from about 156 s to
/// 340 s, into a bay of car park B. Ten poses a second; stops at two crossings and at the gate.
Drive town_drive();

}  // namespace apgm::samples
