#pragma once

#include <cstdint>
#include <map>

namespace apgm::format {

/// Which numbers of a row arrived, in any order: kept as the gaps between them, of which there are at most
/// kMostGaps. Beyond that the oldest are given up.
class Numbers {
 public:
  static constexpr std::size_t kMostGaps = 4096;
  enum class Arrival : std::uint8_t { kNew, kDuplicate, kLate };

  /// What the arrival of `number`, at least 1, is. Late: it can no longer be told.
  Arrival look(std::uint64_t number) const;
  /// `number`, which is new, arrived.
  void add(std::uint64_t number);
  /// `number`, which was added, is of no use after all.
  void remove(std::uint64_t number);

  std::uint64_t greatest() const { return greatest_; }
  /// Nothing below the greatest can still arrive.
  bool closed() const { return gaps_.empty(); }
  /// Numbers up to the greatest that did not arrive.
  std::uint64_t missing() const { return missing_; }
  /// The same from `first` to `last`; of those given up at most.
  std::uint64_t missing(std::uint64_t first, std::uint64_t last) const;

 private:
  void add_gap(std::uint64_t first, std::uint64_t last);
  std::map<std::uint64_t, std::uint64_t>::const_iterator gap_of(std::uint64_t number) const;

  std::map<std::uint64_t, std::uint64_t> gaps_;  // first to last, apart from each other
  std::uint64_t greatest_ = 0;
  std::uint64_t floor_ = 0;  // nothing is known of numbers up to this one
  std::uint64_t given_up_ = 0;
  std::uint64_t missing_ = 0;
};

}  // namespace apgm::format
