#pragma once

#include <algorithm>
#include <unordered_map>
#include <utility>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/core/frame.hpp"
#include "layouts/allocation.hpp"

/// Where the tiles of a sub-map grid are kept. Each container has the same members:
///   const Tile* find(i) const, Tile* find(i)   nullptr if absent
///   void insert(i, tile)                       of an absent index
///   void erase_if(drop)                        those for which drop(i)
///   void for_each(visit) const, for_each(visit)  visit(i, tile)
///   Container clone(floats) const              of tiles of so many floats
///   std::size_t size() const
///   std::uint64_t table_bytes() const          of the heap, without the tiles
namespace apgm::layouts {

/// A slot for every index of the bounding box.
template <class Tile>
class DenseTiles {
 public:
  const Tile* find(PatchIndex i) const {
    if (!range_.contains(i)) return nullptr;
    const Tile& tile = slots_[slot(range_, i)];
    return tile ? &tile : nullptr;
  }
  Tile* find(PatchIndex i) { return const_cast<Tile*>(std::as_const(*this).find(i)); }

  void insert(PatchIndex i, Tile tile) {
    if (!range_.contains(i)) {
      PatchRange grown = range_;
      grown.add(i);
      rearrange(grown);
    }
    slots_[slot(range_, i)] = std::move(tile);
    ++size_;
  }

  template <class Drop>
  void erase_if(Drop&& drop) {
    PatchRange left;
    size_ = 0;
    for_each([&](PatchIndex i, Tile& tile) {
      if (drop(i)) {
        tile = Tile();
      } else {
        left.add(i);
        ++size_;
      }
    });
    if (left != range_) rearrange(left);
  }

  template <class Visit>
  void for_each(Visit&& visit) const {
    const_cast<DenseTiles*>(this)->for_each([&](PatchIndex i, Tile& tile) { visit(i, std::as_const(tile)); });
  }
  template <class Visit>
  void for_each(Visit&& visit) {
    std::size_t k = 0;
    if (slots_.empty()) return;
    for (std::int64_t y = range_.min.y; y <= range_.max.y; ++y) {
      for (std::int64_t x = range_.min.x; x <= range_.max.x; ++x, ++k) {
        if (slots_[k])
          visit(PatchIndex{static_cast<std::int32_t>(x), static_cast<std::int32_t>(y)}, slots_[k]);
      }
    }
  }

  DenseTiles clone(std::size_t floats) const {
    DenseTiles copy;
    copy.range_ = range_;
    copy.size_ = size_;
    copy.slots_.resize(slots_.size());
    for (std::size_t k = 0; k < slots_.size(); ++k) {
      if (slots_[k]) copy.slots_[k] = slots_[k].clone(floats);
    }
    return copy;
  }
  std::size_t size() const { return size_; }
  std::uint64_t table_bytes() const { return heap_bytes(slots_.capacity() * sizeof(Tile)); }

 private:
  static constexpr std::int64_t kMaxSlots = std::int64_t{1} << 24;

  static std::int64_t width(const PatchRange& range) { return std::int64_t{range.max.x} - range.min.x + 1; }
  static std::size_t slot(const PatchRange& range, PatchIndex i) {
    return static_cast<std::size_t>((std::int64_t{i.y} - range.min.y) * width(range) + i.x - range.min.x);
  }

  void rearrange(const PatchRange& range) {
    if (range.empty()) {
      *this = DenseTiles();
      return;
    }
    const std::int64_t height = std::int64_t{range.max.y} - range.min.y + 1;
    if (width(range) > kMaxSlots / height) {
      throw Error(ErrorCode::kLimit, "the sub-maps lie too far apart for a dense array");
    }
    std::vector<Tile> slots(static_cast<std::size_t>(width(range) * height));
    for_each([&](PatchIndex i, Tile& tile) { slots[slot(range, i)] = std::move(tile); });
    slots_ = std::move(slots);
    range_ = range;
  }

  PatchRange range_;
  std::vector<Tile> slots_;
  std::size_t size_ = 0;
};

/// A hash table of the standard library.
template <class Tile>
class HashedTiles {
 public:
  HashedTiles() = default;
  /// Assignment would part the table from what counts its bytes.
  HashedTiles(HashedTiles&&) = default;
  const Tile* find(PatchIndex i) const {
    const auto it = tiles_.find(i);
    return it == tiles_.end() ? nullptr : &it->second;
  }
  Tile* find(PatchIndex i) { return const_cast<Tile*>(std::as_const(*this).find(i)); }
  void insert(PatchIndex i, Tile tile) { tiles_.emplace(i, std::move(tile)); }
  template <class Drop>
  void erase_if(Drop&& drop) {
    std::erase_if(tiles_, [&](const auto& entry) { return drop(entry.first); });
  }
  template <class Visit>
  void for_each(Visit&& visit) const {
    for (const auto& [i, tile] : tiles_) visit(i, tile);
  }
  template <class Visit>
  void for_each(Visit&& visit) {
    for (auto& [i, tile] : tiles_) visit(i, tile);
  }
  HashedTiles clone(std::size_t floats) const {
    HashedTiles copy;
    copy.tiles_.reserve(tiles_.size());
    for (const auto& [i, tile] : tiles_) copy.tiles_.emplace(i, tile.clone(floats));
    return copy;
  }
  std::size_t size() const { return tiles_.size(); }
  std::uint64_t table_bytes() const { return *bytes_; }

 private:
  struct Hash {
    std::size_t operator()(PatchIndex i) const noexcept {
      // Neighbours differ in low bits only, and a table of a power of two would keep them in few buckets.
      std::uint64_t z =
          std::uint64_t{static_cast<std::uint32_t>(i.x)} << 32 | static_cast<std::uint32_t>(i.y);
      z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
      z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
      return z ^ (z >> 31);
    }
  };
  using Allocator = CountingAllocator<std::pair<const PatchIndex, Tile>>;

  // Before the table, which gives its memory back last. What counts is not counted itself.
  std::unique_ptr<std::uint64_t> bytes_ = std::make_unique<std::uint64_t>(0);
  std::unordered_map<PatchIndex, Tile, Hash, std::equal_to<PatchIndex>, Allocator> tiles_{
      Allocator(bytes_.get())};
};

/// A vector sorted by index, searched by halving.
template <class Tile>
class SortedTiles {
 public:
  const Tile* find(PatchIndex i) const {
    const auto it = lower_bound(i);
    return it == entries_.end() || it->index != i ? nullptr : &it->tile;
  }
  Tile* find(PatchIndex i) { return const_cast<Tile*>(std::as_const(*this).find(i)); }
  void insert(PatchIndex i, Tile tile) { entries_.insert(lower_bound(i), Entry{i, std::move(tile)}); }
  template <class Drop>
  void erase_if(Drop&& drop) {
    std::erase_if(entries_, [&](const Entry& entry) { return drop(entry.index); });
  }
  template <class Visit>
  void for_each(Visit&& visit) const {
    for (const Entry& entry : entries_) visit(entry.index, entry.tile);
  }
  template <class Visit>
  void for_each(Visit&& visit) {
    for (Entry& entry : entries_) visit(entry.index, entry.tile);
  }
  SortedTiles clone(std::size_t floats) const {
    SortedTiles copy;
    copy.entries_.reserve(entries_.size());
    for (const Entry& entry : entries_) copy.entries_.push_back({entry.index, entry.tile.clone(floats)});
    return copy;
  }
  std::size_t size() const { return entries_.size(); }
  std::uint64_t table_bytes() const { return heap_bytes(entries_.capacity() * sizeof(Entry)); }

 private:
  struct Entry {
    PatchIndex index;
    Tile tile;
  };
  auto lower_bound(PatchIndex i) const {
    return std::ranges::lower_bound(entries_, i, {}, [](const Entry& entry) { return entry.index; });
  }

  std::vector<Entry> entries_;
};

}  // namespace apgm::layouts
