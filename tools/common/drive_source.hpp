#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "apgm/observe/mapper.hpp"
#include "converters/scans/scan_reader.hpp"
#include "tools/common/memory.hpp"

namespace apgm::tools {

struct DriveRequest {
  converters::ScanRequest scans;
  Frame frame;
  Models models;
  Schedule schedule;
  MemoryLeft memory_left;  ///< what the live map may take, with all that lives beside it
  /// @throws Error as Profile::check
  void check() const;
};

/// After one measurement of a drive.
struct DriveMoment {
  double time_s = 0;  ///< since the first
  std::string profile;
  Point vehicle;
};

/// A live map that follows the vehicle through a recording.
class DriveSource {
 public:
  virtual ~DriveSource() = default;
  /// Maps the next measurement; false at the end. @throws over_budget() before the map grows beyond it
  virtual bool next(DriveMoment& out) = 0;
  /// The live map now.
  virtual const Map& map() = 0;
  virtual std::uint64_t measurements() const = 0;
  virtual std::uint64_t bytes_done() const { return 0; }
  virtual std::uint64_t total_bytes() const { return 0; }
  /// What was left out, for people.
  virtual std::vector<std::string> faults() const { return {}; }
};

/// Laser scans and clouds, mapped as by apgm-map. @throws Error as open_scans
std::unique_ptr<DriveSource> open_drive(const DriveRequest& request);
/// Poses alone (KITTI, ten a second; TUM): wherever the profile asks for a layer, there is one, every cell
/// with data. @throws Error as read_poses, {kForeign} for lists of clouds
std::unique_ptr<DriveSource> open_motion(const DriveRequest& request);

}  // namespace apgm::tools
