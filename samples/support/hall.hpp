#pragma once

#include <cstdint>

#include "apgm/observe/measurement.hpp"

namespace apgm::samples {

/// What a laser on a robot measures in a hall of 60 m x 20 m with its corner at the origin, in steps of half
/// a degree.
/// @param robot      in the hall; it faces +x
/// @param first_rad  angle of the first of `beams`
LaserScan scan_of_the_hall(Point robot, std::int64_t stamp_ns, double first_rad, int beams);

}  // namespace apgm::samples
