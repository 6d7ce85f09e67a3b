#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apgm/core/map_changes.hpp"
#include "apgm/core/source.hpp"
#include "apgm/core/working_memory.hpp"
#include "apgm/ops/run.hpp"

namespace apgm {

struct ChangesNames {
  std::string base = "the base";  ///< for messages
  std::string other = "the other map";
};

/// What brings one map to another: the layers of `other` that `base` lacks or holds with other cells or
/// another stamp, as a source, and what is gone. Types are matched by name. Where both sources know their
/// content hashes, no layer is read; else the cells are compared. Memory: what is gone, and a bit for each
/// layer of `other`. Error bounds and encodings do not count.
///
/// Thread rule: as PatchSource. Both sources outlive it.
class ChangesSource final : public PatchSource, public WorkingMemory {
 public:
  /// Walks both indexes once.
  /// @throws Error{kIncompatible} if the frames differ, and says in what; {kDamaged|kUnreadable|kCancelled}
  ChangesSource(const PatchSource& base, const PatchSource& other, const RunOptions& run = {},
                const ChangesNames& names = {});
  ~ChangesSource() override;

  /// Layers of `base` that `other` lacks, by (curve_key, name). A layer whose type stands for another space
  /// in `other` is not gone but changed.
  const std::vector<MapChanges::Gone>& gone() const;
  bool empty() const;

  /// That of `other`.
  const MapHeader& header() const override;
  Summary summary() const override;
  std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>& range = {}) const override;
  void load(const LayerInfo& info, Layer& out) const override;
  bool load_stored(const LayerInfo& info, StoredLayer& out) const override;
  /// That of `other`.
  std::uint64_t working_bytes(std::uint64_t layer_bytes) const override;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace apgm
