#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "apgm/core/source.hpp"

namespace apgm::test {

/// A map that is large in memory and small on the disk: its layers repeat one pattern.
struct BigMap {
  std::uint64_t value_bytes = std::uint64_t{320} << 20;  ///< decoded, at least
  int step = 7;
  std::int64_t datum_um = 0;  ///< on both axes
  int pattern = 0;            ///< another number: other cells
  /// Occupancy always; with `heights` a second type of one real channel.
  bool heights = false;

  /// Patches along each side of the square that is covered.
  int side() const;
  /// Writes the file patch by patch: the program that calls it stays small.
  void write(const std::string& path) const;
};

}  // namespace apgm::test
