#include "diff_regions.hpp"

#include <algorithm>
#include <numeric>
#include <tuple>

namespace apgm::ops {
namespace {

constexpr int kBlockLog2 = kMaxStep - PatchBlocks::kStep;  // cells of the finest step along a block
constexpr std::uint32_t kBlockArea = 1u << (2 * kBlockLog2);

/// Where an entry lies among the blocks of all space.
struct Spot {
  std::int64_t y = 0, x = 0;
  std::uint32_t entry = 0;
  friend bool operator<(const Spot& a, const Spot& b) { return std::tie(a.y, a.x) < std::tie(b.y, b.x); }
};

/// Disjoint sets of numbers.
class Sets {
 public:
  explicit Sets(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0u); }
  std::uint32_t find(std::uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  /// The lower root stays, so that roots do not depend on the order of joins.
  void join(std::uint32_t a, std::uint32_t b) {
    a = find(a);
    b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::uint32_t> parent_;
};

/// Half-open, in cells of the finest step from the datum.
struct Extent {
  std::int64_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  std::uint64_t area = 0;

  void add(PatchIndex patch, const PatchBlocks::Block& b) {
    const std::int64_t x = std::int64_t{patch.x} << kMaxStep, y = std::int64_t{patch.y} << kMaxStep;
    const Extent o{x + b.x0, y + b.y0, x + b.x1, y + b.y1, b.area};
    if (area == 0) {
      *this = o;
      return;
    }
    x0 = std::min(x0, o.x0);
    y0 = std::min(y0, o.y0);
    x1 = std::max(x1, o.x1);
    y1 = std::max(y1, o.y1);
    area += o.area;
  }
};

DiffRegion region_of(const Extent& e, const Frame& frame) {
  const double cell_um = static_cast<double>(frame.edge_um) / (1 << kMaxStep);
  const auto metres = [&](std::int64_t datum_um, std::int64_t cells) {
    return (static_cast<double>(datum_um) + cell_um * static_cast<double>(cells)) / 1e6;
  };
  const double cell_m = frame.cell_m(kMaxStep);
  return {{{metres(frame.datum_x_um, e.x0), metres(frame.datum_y_um, e.y0)},
           {metres(frame.datum_x_um, e.x1), metres(frame.datum_y_um, e.y1)}},
          static_cast<double>(e.area) * (cell_m * cell_m)};
}

/// Joins neighbours in a row and from row to row, also at corners. `spots` are sorted.
Sets joined(const std::vector<Spot>& spots) {
  Sets sets(spots.size());
  std::size_t below = 0;  // first spot that may touch the one at hand from the row below
  for (std::size_t i = 0; i < spots.size(); ++i) {
    const Spot& s = spots[i];
    const auto self = static_cast<std::uint32_t>(i);
    if (i > 0 && spots[i - 1].y == s.y && spots[i - 1].x == s.x - 1) sets.join(self, self - 1);
    while (below < i && spots[below] < Spot{s.y - 1, s.x - 1, 0}) ++below;
    for (std::size_t k = below; k < i && !(Spot{s.y - 1, s.x + 1, 0} < spots[k]); ++k) {
      sets.join(self, static_cast<std::uint32_t>(k));
    }
  }
  return sets;
}

}  // namespace

void PatchBlocks::Block::add(const Block& other) {
  if (other.area == 0) return;
  if (area == 0) {
    *this = other;
    return;
  }
  area += other.area;
  x0 = std::min(x0, other.x0);
  y0 = std::min(y0, other.y0);
  x1 = std::max(x1, other.x1);
  y1 = std::max(y1, other.y1);
}

void PatchBlocks::clear() {
  if (any_) blocks_.fill({});
  any_ = false;
}

void PatchBlocks::add(CellIndex cell, int step) {
  any_ = true;
  const auto first = [&](std::int32_t i, int to) { return step >= to ? i >> (step - to) : i << (to - step); };
  const auto coordinate = [](std::int32_t i) { return static_cast<std::uint16_t>(i); };
  const std::int32_t size = 1 << (kMaxStep - step);
  if (step >= kStep) {
    const std::int32_t x = cell.a * size, y = cell.b * size;
    blocks_[static_cast<std::size_t>(first(cell.b, kStep) * 8 + first(cell.a, kStep))].add(
        {static_cast<std::uint32_t>(size) * static_cast<std::uint32_t>(size), coordinate(x), coordinate(y),
         coordinate(x + size), coordinate(y + size)});
    return;
  }
  // A cell over several blocks.
  constexpr std::int32_t kSide = 1 << kBlockLog2;
  const std::int32_t a0 = first(cell.a, kStep), b0 = first(cell.b, kStep), n = 1 << (kStep - step);
  for (std::int32_t b = b0; b < b0 + n; ++b) {
    for (std::int32_t a = a0; a < a0 + n; ++a) {
      blocks_[static_cast<std::size_t>(b * 8 + a)].add({kBlockArea, coordinate(a * kSide),
                                                        coordinate(b * kSide), coordinate((a + 1) * kSide),
                                                        coordinate((b + 1) * kSide)});
    }
  }
}

void PatchBlocks::join(const PatchBlocks& other) {
  if (other.empty()) return;
  any_ = true;
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const std::uint32_t area = std::max(blocks_[i].area, other.blocks_[i].area);
    blocks_[i].add(other.blocks_[i]);
    blocks_[i].area = area;
  }
}

std::uint64_t RegionFinder::most_bytes(std::uint64_t patches) {
  // The list with the room it grew into; its spots, sets and extents; what is given back.
  constexpr std::uint64_t kABlock =
      2 * sizeof(Entry) + sizeof(Spot) + sizeof(std::uint32_t) + sizeof(Extent) + sizeof(DiffRegion);
  return kABlock *
         std::min<std::uint64_t>(64 * std::min<std::uint64_t>(patches, kMostBlocks), kMostBlocks + 64);
}

void RegionFinder::add(PatchIndex patch, const PatchBlocks& blocks) {
  if (blocks.empty()) return;
  const std::size_t first = entries_.size();
  const int down = PatchBlocks::kStep - step_;
  for (int i = 0; i < 64; ++i) {
    const PatchBlocks::Block& block = blocks.blocks()[static_cast<std::size_t>(i)];
    if (block.area == 0) continue;
    const int place = ((i / 8) >> down) * (1 << step_) + ((i % 8) >> down);
    add_entry({patch, block, static_cast<std::uint8_t>(place)}, first);
  }
  while (entries_.size() > most_blocks_ && step_ > 0) coarsen();
}

void RegionFinder::add_entry(const Entry& entry, std::size_t first_of_patch) {
  for (std::size_t i = first_of_patch; i < entries_.size(); ++i) {
    if (entries_[i].place == entry.place) return entries_[i].block.add(entry.block);
  }
  entries_.push_back(entry);
}

void RegionFinder::coarsen() {
  const int side = 1 << step_;
  std::vector<Entry> fine;
  fine.swap(entries_);
  --step_;
  std::size_t first = 0;
  for (const Entry& e : fine) {
    if (entries_.empty() || entries_.back().patch != e.patch) first = entries_.size();
    const int place = (e.place / side / 2) * (side / 2) + e.place % side / 2;
    add_entry({e.patch, e.block, static_cast<std::uint8_t>(place)}, first);
  }
}

std::vector<DiffRegion> RegionFinder::regions(const Frame& frame) const {
  const int side = 1 << step_;
  std::vector<Spot> spots;
  spots.reserve(entries_.size());
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const Entry& e = entries_[i];
    spots.push_back({std::int64_t{e.patch.y} * side + e.place / side,
                     std::int64_t{e.patch.x} * side + e.place % side, static_cast<std::uint32_t>(i)});
  }
  std::ranges::sort(spots, [](const Spot& a, const Spot& b) { return a < b; });
  Sets sets = joined(spots);
  std::vector<Extent> extents(spots.size());
  for (std::size_t i = 0; i < spots.size(); ++i) {
    const Entry& e = entries_[spots[i].entry];
    extents[sets.find(static_cast<std::uint32_t>(i))].add(e.patch, e.block);
  }
  std::erase_if(extents, [](const Extent& e) { return e.area == 0; });
  std::ranges::sort(extents, [](const Extent& a, const Extent& b) {
    return std::tie(b.area, a.y0, a.x0, a.y1, a.x1) < std::tie(a.area, b.y0, b.x0, b.y1, b.x1);
  });
  std::vector<DiffRegion> out;
  out.reserve(extents.size());
  for (const Extent& e : extents) out.push_back(region_of(e, frame));
  return out;
}

}  // namespace apgm::ops
