#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "layouts/allocation.hpp"

namespace apgm::layouts {

/// The cells of one sub-map, in memory of its own.
class OwnTile {
 public:
  OwnTile() = default;
  explicit OwnTile(std::size_t floats) : cells_(new float[floats]) {}
  explicit operator bool() const { return cells_ != nullptr; }
  const float* read() const { return cells_.get(); }
  float* edit(std::size_t /*floats*/) { return cells_.get(); }
  OwnTile clone(std::size_t floats) const {
    OwnTile copy(floats);
    std::copy_n(read(), floats, copy.cells_.get());
    return copy;
  }
  static std::uint64_t bytes(std::size_t floats) { return heap_bytes(floats * sizeof(float)); }

 private:
  std::unique_ptr<float[]> cells_;
};

/// The same, shared with the clones until one of them is written to.
class SharedTile {
 public:
  SharedTile() = default;
  explicit SharedTile(std::size_t floats) : cells_(std::make_shared_for_overwrite<float[]>(floats)) {}
  explicit operator bool() const { return cells_ != nullptr; }
  const float* read() const { return cells_.get(); }
  float* edit(std::size_t floats) {
    if (cells_.use_count() > 1) {
      SharedTile copy(floats);
      std::copy_n(read(), floats, copy.cells_.get());
      *this = std::move(copy);
    }
    return cells_.get();
  }
  SharedTile clone(std::size_t /*floats*/) const { return *this; }
  /// With the control block before the cells.
  static std::uint64_t bytes(std::size_t floats) {
    return heap_bytes(floats * sizeof(float) + kControlBytes);
  }

 private:
  static constexpr std::uint64_t kControlBytes = 44;  // table, counts, length, padding in libstdc++ 12
  std::shared_ptr<float[]> cells_;
};

}  // namespace apgm::layouts
