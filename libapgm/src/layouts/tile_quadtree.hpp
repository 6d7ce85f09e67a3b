#pragma once

#include <array>
#include <memory>
#include <utility>

#include "apgm/core/frame.hpp"
#include "layouts/allocation.hpp"

namespace apgm::layouts {

/// A quadtree over patch indices, a container of tiles as those of tile_containers.hpp. Its root covers a
/// square of 2^level indices a side, aligned to its size, and rises as indices come that it does not cover.
template <class Tile>
class QuadtreeTiles {
 public:
  const Tile* find(PatchIndex i) const {
    const Key key(i);
    const Node* node = covers(key) ? root_.get() : nullptr;
    for (int level = level_; node != nullptr && level > 0; --level) node = node->child[key.at(level)].get();
    return node == nullptr ? nullptr : &node->tile;
  }
  Tile* find(PatchIndex i) { return const_cast<Tile*>(std::as_const(*this).find(i)); }

  void insert(PatchIndex i, Tile tile) {
    const Key key(i);
    if (root_ == nullptr) {
      level_ = 0;
      place_ = key;
    }
    while (root_ != nullptr && !covers(key)) raise();
    std::unique_ptr<Node>* node = &root_;
    for (int level = level_; level > 0; --level) {
      made(*node);
      node = &(*node)->child[key.at(level)];
    }
    made(*node);
    (*node)->tile = std::move(tile);
    ++size_;
  }

  template <class Drop>
  void erase_if(Drop&& drop) {
    prune(root_, level_, place_, drop);
  }
  template <class Visit>
  void for_each(Visit&& visit) const {
    const_cast<QuadtreeTiles*>(this)->for_each(
        [&](PatchIndex i, Tile& tile) { visit(i, std::as_const(tile)); });
  }
  template <class Visit>
  void for_each(Visit&& visit) {
    walk(root_.get(), level_, place_, visit);
  }
  QuadtreeTiles clone(std::size_t floats) const {
    QuadtreeTiles copy;
    copy.root_ = copy_of(root_.get(), floats);
    copy.level_ = level_;
    copy.place_ = place_;
    copy.size_ = size_;
    copy.nodes_ = nodes_;
    return copy;
  }
  std::size_t size() const { return size_; }
  std::uint64_t table_bytes() const { return nodes_ * heap_bytes(sizeof(Node)); }

 private:
  /// An index with its origin at the least one, so that halving goes down everywhere.
  struct Key {
    std::uint32_t x = 0, y = 0;
    Key() = default;
    Key(std::uint32_t kx, std::uint32_t ky) : x(kx), y(ky) {}
    explicit Key(PatchIndex i)
        : x(static_cast<std::uint32_t>(i.x) ^ 0x80000000u),
          y(static_cast<std::uint32_t>(i.y) ^ 0x80000000u) {}
    PatchIndex index() const {
      return {static_cast<std::int32_t>(x ^ 0x80000000u), static_cast<std::int32_t>(y ^ 0x80000000u)};
    }
    /// Which child of a node of `level` holds the key.
    std::size_t at(int level) const { return ((y >> (level - 1)) & 1) * 2 + ((x >> (level - 1)) & 1); }
  };
  struct Node {
    std::array<std::unique_ptr<Node>, 4> child;  // of inner nodes
    Tile tile;                                   // of leaves
  };

  bool covers(Key key) const {
    return std::uint64_t{key.x ^ place_.x} >> level_ == 0 && std::uint64_t{key.y ^ place_.y} >> level_ == 0;
  }

  void made(std::unique_ptr<Node>& node) {
    if (node != nullptr) return;
    node = std::make_unique<Node>();
    ++nodes_;
  }

  void raise() {
    auto above = std::make_unique<Node>();
    ++nodes_;
    ++level_;
    above->child[place_.at(level_)] = std::move(root_);
    root_ = std::move(above);
    const std::uint32_t below = level_ < 32 ? (std::uint32_t{1} << level_) - 1 : ~std::uint32_t{0};
    place_ = {place_.x & ~below, place_.y & ~below};
  }

  static Key child_place(Key place, int level, std::size_t which) {
    const std::uint32_t half = std::uint32_t{1} << (level - 1);
    return {place.x + (which % 2 == 0 ? 0 : half), place.y + (which < 2 ? 0 : half)};
  }

  template <class Visit>
  static void walk(Node* node, int level, Key place, Visit& visit) {
    if (node == nullptr) return;
    if (level == 0) {
      visit(place.index(), node->tile);
      return;
    }
    for (std::size_t k = 0; k < 4; ++k) {
      walk(node->child[k].get(), level - 1, child_place(place, level, k), visit);
    }
  }

  /// Inner nodes without children go too.
  template <class Drop>
  void prune(std::unique_ptr<Node>& node, int level, Key place, Drop& drop) {
    if (node == nullptr) return;
    bool is_empty = true;
    if (level == 0) {
      is_empty = drop(place.index());
      if (is_empty) --size_;
    } else {
      for (std::size_t k = 0; k < 4; ++k) {
        prune(node->child[k], level - 1, child_place(place, level, k), drop);
        is_empty &= node->child[k] == nullptr;
      }
    }
    if (!is_empty) return;
    node.reset();
    --nodes_;
  }

  static std::unique_ptr<Node> copy_of(const Node* node, std::size_t floats) {
    if (node == nullptr) return nullptr;
    auto copy = std::make_unique<Node>();
    if (node->tile) copy->tile = node->tile.clone(floats);
    for (std::size_t k = 0; k < 4; ++k) copy->child[k] = copy_of(node->child[k].get(), floats);
    return copy;
  }

  std::unique_ptr<Node> root_;
  int level_ = 0;
  Key place_;  // least key that the root covers
  std::size_t size_ = 0;
  std::uint64_t nodes_ = 0;
};

}  // namespace apgm::layouts
