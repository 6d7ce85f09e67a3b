#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "apgm/observe/measurement.hpp"
#include "converters/scans/byte_stream.hpp"
#include "converters/scans/faults.hpp"

namespace apgm::converters {

/// Points of a cloud that is read; larger ones are refused (768 MiB of coordinates).
inline constexpr std::uint64_t kMostCloudPoints = std::uint64_t{1} << 26;

/// @throws Error{kLimit}
void check_cloud_size(std::uint64_t points, const std::string& path);

/// A pose that can be: finite, a rotation, within 1e8 m. False, `out` unchanged, for any other.
bool pose_from(std::array<double, 3> position, double w, double x, double y, double z, Pose& out);
bool pose_from(const std::array<double, 9>& rotation, std::array<double, 3> position, Pose& out);

/// One cloud of a file, read from its start.
struct CloudFile {
  ByteStream& bytes;
  ScanFaults& faults;
  PointCloud& cloud;              ///< its points are replaced
  std::optional<Pose> pose = {};  ///< set if the file itself holds one
  bool bad_pose = false;          ///< the file holds one, but an impossible one
};

/// PCD: ascii, binary and binary_compressed; fields x, y, z of 4 or 8 byte floats, others are passed over.
/// @throws Error{kForeign|kDamaged|kUnsupported|kLimit|kUnreadable}
void read_pcd(CloudFile& file);
/// float32 x, y, z, intensity, one point after the other, as KITTI's velodyne scans.
void read_kitti_cloud(CloudFile& file);
/// Lines of numbers divided by commas or blanks: under a heading with x, y and z, as libpointmatcher's
/// clouds, or without one x, y, z first.
void read_csv_cloud(CloudFile& file);

bool sniffs_pcd(std::string_view head);
/// By its heading.
bool sniffs_csv_cloud(std::string_view head);

}  // namespace apgm::converters
