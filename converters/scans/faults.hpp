#pragma once

#include <array>
#include <cstdint>
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
  kLongLine,     ///< a line longer than LineReader takes
  kUnknownLine,  ///< a line of no known kind
  kNoPose,       ///< a cloud the pose file does not know
  kBadCloud,     ///< a cloud that cannot be read
  kCutCloud,     ///< a cloud that ends early; what there is counts
  kNoScan,       ///< a file without any measurement
};
inline constexpr std::size_t kFaultKinds = 11;

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

/// Tells stamps that go back. After many in a row the clock is taken to have been set back for good.
class TimeGuard {
 public:
  bool accepts(std::int64_t stamp_ns);

 private:
  std::int64_t last_ns_ = INT64_MIN;
  int refused_ = 0;
};

}  // namespace apgm::converters
