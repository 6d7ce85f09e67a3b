#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "apgm/core/layer.hpp"
#include "apgm/ops/diff.hpp"
#include "diff_regions.hpp"

namespace apgm::ops {

/// A number of cells of any steps; area in cells of the finest step.
struct Tally {
  std::uint64_t cells = 0;
  std::uint64_t area = 0;

  void add(std::uint64_t n, int step) {
    cells += n;
    area += n << (2 * (kMaxStep - step));
  }
  void add(const Tally& other) {
    cells += other.cells;
    area += other.area;
  }
  CellTally over(const Frame& frame) const;
};

/// A quantity's sum and greatest value.
struct Sum {
  double sum = 0;
  double max = 0;

  void add(double value) {
    sum += value;
    if (value > max) max = value;
  }
  void add(const Sum& other) {
    sum += other.sum;
    if (other.max > max) max = other.max;
  }
  Spread over(std::uint64_t cells) const {
    return {cells == 0 ? 0.0 : sum / static_cast<double>(cells), max};
  }
};

/// Sums behind a TypeDiff: those of a patch are made in its own slot, slots are added in key order.
struct CellSums {
  enum Kind : std::uint8_t {
    kLearned,
    kForgotten,
    kFreeToOccupied,
    kOccupiedToFree,
    kClassChanged,
    kAdjusted
  };

  Tally compared;
  std::array<Tally, 6> kinds;  ///< by Kind
  Sum betp, jousselme, conflict;
  double max_mass_delta = 0;
  double kl = 0;
  struct OfChannel {
    std::uint64_t cells = 0;
    Sum delta;
  };
  std::vector<OfChannel> channels;

  void add(const CellSums& other);
  std::uint64_t changed() const;
  /// Writes the figures of `out` that are about cells.
  void report(const Frame& frame, TypeDiff& out) const;
};

/// What `compare` fills beside the sums.
struct CellOutputs {
  PatchBlocks* blocks = nullptr;  ///< where cells changed
  CellDiff* cells = nullptr;      ///< of every cell
};

/// Compares two layers of one space and one step cell by cell.
/// @param tolerance  empty: any bit counts
void compare(const Layer& a, const Layer& b, const LayerType& type, std::optional<double> tolerance,
             CellSums& sums, const CellOutputs& outputs);

/// The cells of one layer that both maps have.
void describe_equal(const Layer& layer, const LayerType& type, CellDiff* out);

}  // namespace apgm::ops
