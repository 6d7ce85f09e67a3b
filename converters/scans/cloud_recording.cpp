#include "converters/scans/cloud_recording.hpp"

#include "converters/scans/cloud.hpp"

namespace apgm::converters {

CloudRecording::CloudRecording(std::vector<PlacedCloud> clouds, ScanFaults& faults,
                               const std::atomic<bool>* cancel)
    : clouds_(std::move(clouds)), faults_(faults), cancel_(cancel) {}

bool CloudRecording::next(Measurement& out) {
  while (at_ < clouds_.size()) {
    const std::size_t number = at_++;
    const PlacedCloud& placed = clouds_[number];
    if (placed.lost) continue;
    PointCloud& cloud = as<PointCloud>(out);
    cloud.stamp_ns = placed.stamp_ns.value_or(static_cast<std::int64_t>(number) * kScanInterval_ns);
    if (const std::optional<Fault> out_of_order = times_.fault_of(cloud.stamp_ns)) {
      faults_.add(*out_of_order, [&] { return placed.path; });
    } else if (read(placed, cloud)) {
      return true;
    }
  }
  return false;
}

/// A cloud that is damaged costs no more than itself.
bool CloudRecording::read(const PlacedCloud& placed, PointCloud& cloud) {
  ByteStream bytes(placed.path, cancel_);
  CloudFile file{bytes, faults_, cloud};
  std::string why = "it holds no point";
  try {
    if (placed.format == Format::kPcd) read_pcd(file);
    if (placed.format == Format::kKitti) read_kitti_cloud(file);
    if (placed.format == Format::kCsv) read_csv_cloud(file);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kUnreadable || error.code() == ErrorCode::kCancelled) throw;
    cloud.xyz_m.clear();
    why = error.message();
  }
  bytes_done_ += bytes.bytes_done();
  if (cloud.xyz_m.empty()) {
    faults_.add(Fault::kBadCloud,
                [&] { return why.find(placed.path) == why.npos ? "'" + placed.path + "': " + why : why; });
    return false;
  }
  if (!placed.pose && file.bad_pose) {
    faults_.add(Fault::kBadPose, [&] { return placed.path; });
    return false;
  }
  cloud.pose = placed.pose.value_or(file.pose.value_or(Pose{}));
  return true;
}

}  // namespace apgm::converters
