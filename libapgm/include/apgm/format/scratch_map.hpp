#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "apgm/core/patch_store.hpp"
#include "apgm/core/source.hpp"

namespace apgm {

/// Patches in a file without a name: a PatchStore that takes any number of them in any order, and a
/// PatchSource that gives them in key order, as stored bytes too. Memory: the index alone, some 100 bytes a
/// layer. Space of replaced patches is used again once it is more than half of the file.
///
/// Thread rule: as PatchSource while nothing is stored or taken.
class ScratchMap final : public PatchStore, public PatchSource {
 public:
  /// @param directory  where the file lies; nothing is visible there
  /// @throws Error{kOutput}
  ScratchMap(MapHeader header, const std::string& directory);
  ~ScratchMap() override;

  void store(Patch& patch) override;
  bool take(PatchIndex index, Patch& out) override;

  /// Replaces the header; layers keep their types by id, so types may only be added where ids do not change,
  /// else Error{kIncompatible}.
  void set_header(MapHeader header);

  const MapHeader& header() const override;
  Summary summary() const override;
  std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>& range = {}) const override;
  void load(const LayerInfo& info, Layer& out) const override;
  bool load_stored(const LayerInfo& info, StoredLayer& out) const override;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace apgm
