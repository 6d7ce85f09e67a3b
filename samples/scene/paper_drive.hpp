#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "apgm/observe/mapper.hpp"

namespace apgm::samples {

struct PaperDriveOptions {
  std::uint64_t seed = 1;  ///< of town and noise
  double from_s = 0;       ///< begins at the nearest step, with an empty map
  double seconds = 465;    ///< and goes on for so long, at most to the end of the drive
};

/// The live map after the measurements of one tenth of a second.
struct DriveStep {
  double time_s = 0;    ///< since the drive began
  std::string profile;  ///< that holds now
  Point vehicle;        ///< metres of the map's CRS
  std::uint64_t patches = 0;
  struct OfLayer {
    std::uint64_t cells = 0;  ///< allocated, those of both channels and all rows of each layer
    std::uint64_t bytes = 0;  ///< of their values
    std::uint64_t known = 0;  ///< cells that hold data
    double observe_s = 0;     ///< measurements to layers, all sensors of the step
    double fuse_s = 0;        ///< layers into the map
    double upkeep_s = 0;      ///< ageing, resampling and dropping, as the vehicle moves
  } occupancy, semantics;
};

/// The drive of the paper's evaluation (Sec. V-A) in town_scene(): two lidars and a front camera, ten times a
/// second, a Mapper that follows the vehicle, and profiles that change on the way. The camera is off while
/// the profile wants no semantics. A part of the drive has the very measurements it has in the whole.
///
/// Guarantees: same map for the same arguments on every machine; times are measured and differ.
/// @param on_step  called after each step
/// @return         the live map at the end
/// @throws Error as Mapper, Profile::check
Map run_paper_drive(const PaperDriveOptions& options, const Models& models, const Schedule& schedule,
                    const std::function<void(const DriveStep&, const Map&)>& on_step);

}  // namespace apgm::samples
