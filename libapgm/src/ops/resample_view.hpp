#pragma once

#include <optional>
#include <vector>

#include "apgm/core/source.hpp"

namespace apgm::ops {

/// A source whose types carry other policies: what is resampled from it follows these. Cells keep their
/// values; where a policy gives cells without data another value (NaN or, for counts, 0), they get it.
class PolicyView final : public PatchSource {
 public:
  /// @param types  those of the source, save for their policies
  PolicyView(const PatchSource& source, TypeTable types);

  const MapHeader& header() const override { return header_; }
  Summary summary() const override { return source_.summary(); }
  std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>& range = {}) const override {
    return source_.patches(range);
  }
  void load(const LayerInfo& info, Layer& out) const override;
  bool load_stored(const LayerInfo& info, StoredLayer& out) const override;

 private:
  const PatchSource& source_;
  MapHeader header_;
  std::vector<bool> same_;  // by type: cells without data have the same value
};

}  // namespace apgm::ops
