#pragma once

#include "converters/scans/faults.hpp"
#include "converters/scans/recording.hpp"

namespace apgm::converters {

/// OctoMap's scan graphs: clouds with poses (docs/scans.md). OctoMap's own reader takes memory for as many
/// points as the file claims, so this one does without it.
class ScanGraph final : public Recording {
 public:
  ScanGraph(std::unique_ptr<ByteStream> bytes, ScanFaults& faults);

  bool next(Measurement& out) override;
  std::uint64_t bytes_done() const override { return bytes_->bytes_done(); }

  static bool sniffs(std::string_view head);

 private:
  void read_points(PointCloud& cloud);
  bool read_pose(Pose& pose);
  std::uint32_t read_count(const char* what);
  void read_vector(std::uint32_t dimensions, double* out);
  void read_exactly(char* out, std::size_t n);
  [[noreturn]] void damaged(const std::string& what) const;

  std::unique_ptr<ByteStream> bytes_;
  ScanFaults& faults_;
  std::uint64_t nodes_ = 0, node_ = 0;
  bool started_ = false;
};

}  // namespace apgm::converters
