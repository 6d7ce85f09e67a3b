#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "converters/scans/scan_reader.hpp"

namespace apgm::converters {

/// Kinds of ScanFault.
enum class Fault : std::uint8_t {
  kCutLine,      ///< a line ends before its last word
  kBeamCount,    ///< a line holds another number of readings than it says
  kBadNumber,    ///< text or an impossible value where a number belongs
  kBadPose,      ///< a pose that is not finite, no rotation, or far beyond the earth
  kTimeBack,     ///< a stamp before that of the last scan
  kTimeAhead,    ///< a stamp far beyond that of the last scan, which the next scan does not bear out
  kLongLine,     ///< a line longer than LineReader takes
  kUnknownLine,  ///< a line of no known kind
  kNoPose,       ///< a cloud the pose file does not know
  kBadCloud,     ///< a cloud that cannot be read
  kCutCloud,     ///< a cloud that ends early; what there is counts
  kNoScan,       ///< a file without any measurement
};
inline constexpr std::size_t kFaultKinds = 12;

/// Counts what is left out.
class ScanFaults {
 public:
  /// @param place  only asked for at the first of its kind
  template <class Place>
  void add(Fault kind, const Place& place) {
    Entry& entry = entries_[static_cast<std::size_t>(kind)];
    if (entry.count++ == 0) entry.first = place();
  }
  std::vector<ScanFault> list() const;

 private:
  struct Entry {
    std::uint64_t count = 0;
    std::string first;
  };
  std::array<Entry, kFaultKinds> entries_;
};

/// Tells the scans of one sensor whose stamps are out of order: those that go back, and the first of a jump
/// ahead by more than a day. The clock is taken to have been set for good once 20 in a row went back, or once
/// a second scan follows one that jumped ahead. Stamps within +-4.6e18.
class TimeGuard {
 public:
  /// The fault of the next scan; nullopt: it counts.
  std::optional<Fault> fault_of(std::int64_t stamp_ns);

 private:
  std::int64_t gap_ns_ = 86'400'000'000'000;  // the longest between scans that is believed at once
  std::optional<std::int64_t> last_ns_;       // that counted
  std::optional<std::int64_t> ahead_ns_;      // that jumped ahead since
  int refused_ = 0;                           // since, for going back
};

}  // namespace apgm::converters
