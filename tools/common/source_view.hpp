#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apgm/core/source.hpp"
#include "apgm/core/working_memory.hpp"

namespace apgm::tools {

/// A source as it looks through --layer and --bbox: some of its types, some of its patches. Cells are not
/// touched; a patch is in the view if it shares area with the box and has a layer of the view.
class SourceView final : public PatchSource, public WorkingMemory {
 public:
  /// @param layers  names; empty: all
  /// @throws Error{kInvalidArgument} if the source has no layer of a name
  SourceView(const PatchSource& source, const std::vector<std::string>& layers,
             const std::optional<Box>& box);

  const MapHeader& header() const override { return header_; }
  /// Walks the patches of the view, without reading layers.
  Summary summary() const override;
  std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>& range = {}) const override;
  void load(const LayerInfo& info, Layer& out) const override;
  bool load_stored(const LayerInfo& info, StoredLayer& out) const override;
  std::uint64_t working_bytes(std::uint64_t layer_bytes) const override {
    return apgm::working_bytes(source_, layer_bytes);
  }

 private:
  LayerInfo inner(const LayerInfo& info) const;

  const PatchSource& source_;
  MapHeader header_;
  std::optional<PatchRange> range_;
  std::vector<TypeId> to_source_;                   // by type of the view
  std::vector<std::optional<TypeId>> from_source_;  // by type of the source
};

}  // namespace apgm::tools
