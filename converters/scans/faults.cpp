#include "converters/scans/faults.hpp"

#include <algorithm>

namespace apgm::converters {
namespace {

struct Words {
  const char* key;
  const char* one;
  const char* many;
};

constexpr std::array<Words, kFaultKinds> kWords{{
    {"cut_lines", "line was cut short", "lines were cut short"},
    {"wrong_beam_counts", "line holds another number of readings than it says",
     "lines hold other numbers of readings than they say"},
    {"bad_numbers", "line holds no number where one belongs", "lines hold no number where one belongs"},
    {"bad_poses", "scan has an impossible pose", "scans have impossible poses"},
    {"times_back", "scan has a time before the last one", "scans have times before the last one"},
    {"times_ahead", "scan has a time more than a day after the last one",
     "scans have times more than a day after the last one"},
    {"long_lines", "line is too long", "lines are too long"},
    {"unknown_lines", "line is of no known kind", "lines are of no known kind"},
    {"no_poses", "cloud has no pose in the pose file", "clouds have no pose in the pose file"},
    {"bad_clouds", "cloud cannot be read", "clouds cannot be read"},
    {"cut_clouds", "cloud ends early, the points before count", "clouds end early, the points before count"},
    {"empty_files", "file holds no scan", "files hold no scan"},
}};

constexpr int kClockSetBack = 20;

}  // namespace

std::vector<ScanFault> ScanFaults::list() const {
  std::vector<ScanFault> faults;
  for (std::size_t i = 0; i < kFaultKinds; ++i) {
    const Entry& entry = entries_[i];
    if (entry.count == 0) continue;
    const char* words = entry.count == 1 ? kWords[i].one : kWords[i].many;
    faults.push_back({kWords[i].key, entry.count, entry.first,
                      std::to_string(entry.count) + " " + words + " (first: " + entry.first + ")"});
  }
  return faults;
}

std::optional<Fault> TimeGuard::fault_of(std::int64_t stamp_ns) {
  if (last_ns_ && stamp_ns < *last_ns_) {
    if (++refused_ <= kClockSetBack) return Fault::kTimeBack;
  } else if (last_ns_ && stamp_ns - *last_ns_ > gap_ns_) {
    if (!ahead_ns_ || stamp_ns < *ahead_ns_) {
      ahead_ns_ = stamp_ns;
      return Fault::kTimeAhead;
    }
    gap_ns_ = std::max(gap_ns_, stamp_ns - *ahead_ns_);  // a recording of rare scans
  }
  refused_ = 0;
  ahead_ns_.reset();
  last_ns_ = stamp_ns;
  return {};
}

}  // namespace apgm::converters
