#pragma once

#include <atomic>
#include <memory>

#include "apgm/core/source.hpp"
#include "apgm/core/working_memory.hpp"

namespace apgm::test {

/// A source that counts who reads cells of it, and says that this takes three layers of memory.
class WatchedSource final : public PatchSource, public WorkingMemory {
 public:
  explicit WatchedSource(const PatchSource& source) : source_(source) {}
  const MapHeader& header() const override { return source_.header(); }
  Summary summary() const override { return source_.summary(); }
  std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>& range = {}) const override {
    return source_.patches(range);
  }
  void load(const LayerInfo& info, Layer& out) const override {
    ++loads;
    source_.load(info, out);
  }
  bool load_stored(const LayerInfo& info, StoredLayer& out) const override {
    ++loads;
    return source_.load_stored(info, out);
  }
  std::uint64_t working_bytes(std::uint64_t layer_bytes) const override { return 3 * layer_bytes; }

  mutable std::atomic<int> loads{0};

 private:
  const PatchSource& source_;
};

}  // namespace apgm::test
