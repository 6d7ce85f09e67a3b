#pragma once

#include <string_view>
#include <vector>

#include "converters/scans/faults.hpp"
#include "converters/scans/lines.hpp"
#include "converters/scans/recording.hpp"

namespace apgm::converters {

/// CARMEN logs: FLASER, RLASER, ROBOTLASER1 and ROBOTLASER2 lines (docs/scans.md).
class CarmenLog final : public Recording {
 public:
  CarmenLog(std::unique_ptr<ByteStream> bytes, ScanFaults& faults);

  bool next(Measurement& out) override;
  std::uint64_t bytes_done() const override { return bytes_->bytes_done(); }

  /// True if a file that starts so is such a log.
  static bool sniffs(std::string_view head);

 private:
  bool read_laser(LaserScan& scan);
  bool read_robot_laser(LaserScan& scan);
  bool take_readings(std::size_t from, std::size_t count, LaserScan& scan);
  bool take_place(std::size_t pose_at, std::size_t time_at, LaserScan& scan);
  bool fault(Fault kind);
  bool fault_of_length();

  std::unique_ptr<ByteStream> bytes_;
  LineReader lines_;
  ScanFaults& faults_;
  std::vector<std::string_view> words_;
  std::array<TimeGuard, 4> times_;  // by sensor
};

}  // namespace apgm::converters
