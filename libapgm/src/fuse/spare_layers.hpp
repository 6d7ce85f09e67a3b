#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "apgm/core/layer.hpp"

namespace apgm::fuse {

/// Memory of layers that left, for those that come: page faults cost more than the arithmetic. What counts is
/// the memory a layer keeps, not its shape: one that shrank keeps all of it.
class SpareLayers {
 public:
  static constexpr std::size_t kMost = 64;
  static constexpr std::size_t kMostBytes = std::size_t{32} << 20;

  explicit SpareLayers(std::size_t most_bytes = kMostBytes) : most_bytes_(most_bytes) {}

  /// A layer of some shape; all its values are unspecified. Memory of one that suffices and is at most four
  /// times what is needed, where there is one.
  Layer take(std::size_t value_bytes) {
    auto best = layers_.end();
    for (auto it = layers_.begin(); it != layers_.end(); ++it) {
      if (it->capacity_bytes() < value_bytes || it->capacity_bytes() / 4 > value_bytes) continue;
      if (best == layers_.end() || it->capacity_bytes() < best->capacity_bytes()) best = it;
    }
    if (best == layers_.end()) return {};
    bytes_ -= best->capacity_bytes();
    std::swap(*best, layers_.back());
    Layer layer = std::move(layers_.back());
    layers_.pop_back();
    return layer;
  }

  /// Keeps the memory of `layer`, or frees it when there is enough.
  void keep(Layer&& layer) {
    Layer taken = std::move(layer);
    if (taken.capacity_bytes() == 0 || layers_.size() == kMost) return;
    if (taken.capacity_bytes() > most_bytes_ - bytes_) return;
    bytes_ += taken.capacity_bytes();
    layers_.push_back(std::move(taken));
  }

  std::size_t bytes() const { return bytes_; }

 private:
  std::size_t most_bytes_;
  std::vector<Layer> layers_;
  std::size_t bytes_ = 0;
};

}  // namespace apgm::fuse
