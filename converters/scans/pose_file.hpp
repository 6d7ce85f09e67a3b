#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "converters/scans/faults.hpp"
#include "converters/scans/formats.hpp"

namespace apgm::converters {

/// Where clouds were taken: KITTI rows (3 x 4 matrix), TUM rows (time x y z qx qy qz qw), or
/// libpointmatcher's list (name of the cloud, 4 x 4 matrix), told by the number of values in the first line.
struct PoseFile {
  enum class Kind : std::uint8_t { kKitti, kTum, kList };
  struct Row {
    std::optional<Pose> pose;  ///< nullopt: the row is not usable, but keeps its place
    std::optional<std::int64_t> stamp_ns;
    std::string name;
    std::uint64_t line = 0;
  };
  std::string path;
  Kind kind = Kind::kKitti;
  std::vector<Row> rows;

  std::string place(const Row& row) const { return path + ":" + std::to_string(row.line); }
};

/// @throws Error{kUnreadable}, {kForeign} if it is none of these, {kDamaged} if no row is usable,
///         {kLimit} on more rows than clouds can have; naming file and line
PoseFile read_poses(const std::string& path, ScanFaults& faults);

/// True for libpointmatcher's list of clouds.
bool sniffs_cloud_list(std::string_view head);

/// A cloud of a recording and where it was taken.
struct PlacedCloud {
  std::string path;
  Format format = Format::kPcd;
  std::optional<Pose> pose;  ///< nullopt: as the file itself says
  std::optional<std::int64_t> stamp_ns;
  bool lost = false;  ///< has no usable pose: not read
};

/// Gives poses to clouds: by name where the file names them all; else in order where there are as many rows
/// as clouds; else by the number (KITTI: row, from 0; TUM: time, to 50 ms) that a cloud's name is.
/// @throws Error{kIncompatible} if none of these fits
void place_clouds(const PoseFile& poses, std::vector<PlacedCloud>& clouds, ScanFaults& faults);

}  // namespace apgm::converters
