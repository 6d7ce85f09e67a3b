#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "apgm/ops/diff.hpp"

namespace apgm::ops {

/// Where the cells of a patch changed: by blocks of 8 x 8 a patch. Coordinates and areas count in cells of
/// the finest step.
class PatchBlocks {
 public:
  static constexpr int kStep = 3;

  struct Block {
    std::uint32_t area = 0;
    std::uint16_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;  ///< half-open, from the patch's corner
    void add(const Block& other);
  };

  void clear();
  bool empty() const { return !any_; }
  /// Notes a changed cell of a layer of `step`.
  void add(CellIndex cell, int step);
  /// Keeps, block by block, what has the greater area: for another type of the same patch.
  void join(const PatchBlocks& other);
  /// At b * 8 + a.
  const std::array<Block, 64>& blocks() const { return blocks_; }

 private:
  std::array<Block, 64> blocks_{};
  bool any_ = false;
};

/// Collects changed blocks and finds those that touch, also at corners. Keeps 24 bytes a block, and takes
/// some 160 to answer; beyond `most_blocks` blocks are joined 2 x 2, down to one a patch.
class RegionFinder {
 public:
  static constexpr std::size_t kMostBlocks = std::size_t{1} << 20;

  explicit RegionFinder(std::size_t most_blocks = kMostBlocks) : most_blocks_(most_blocks) {}
  /// Most memory it and its answer take for that many patches.
  static std::uint64_t most_bytes(std::uint64_t patches);

  /// Patches in key order.
  void add(PatchIndex patch, const PatchBlocks& blocks);
  /// Most area first, then by the box's corner: south, then west first.
  std::vector<DiffRegion> regions(const Frame& frame) const;

 private:
  struct Entry {
    PatchIndex patch;
    PatchBlocks::Block block;
    std::uint8_t place = 0;  ///< in the patch: b * 8 + a, counted in blocks of step_
  };
  void add_entry(const Entry& entry, std::size_t first_of_patch);
  void coarsen();

  std::size_t most_blocks_;
  int step_ = PatchBlocks::kStep;
  std::vector<Entry> entries_;
};

}  // namespace apgm::ops
