#pragma once

#include <vector>

#include "converters/scans/pose_file.hpp"
#include "converters/scans/recording.hpp"

namespace apgm::converters {

/// Clouds of one file each, with their poses.
class CloudRecording final : public Recording {
 public:
  CloudRecording(std::vector<PlacedCloud> clouds, ScanFaults& faults, const std::atomic<bool>* cancel);

  bool next(Measurement& out) override;
  std::uint64_t bytes_done() const override { return bytes_done_; }

 private:
  bool read(const PlacedCloud& placed, PointCloud& cloud);

  std::vector<PlacedCloud> clouds_;
  ScanFaults& faults_;
  const std::atomic<bool>* cancel_;
  TimeGuard times_;
  std::size_t at_ = 0;
  std::uint64_t bytes_done_ = 0;
};

}  // namespace apgm::converters
