#pragma once

#include <cstdint>
#include <vector>

#include "apgm/core/source.hpp"

namespace apgm::converters {

/// A source that knows the list of its patches: gives the cursor and the summary, a converter the layers.
///
/// Thread rule: as PatchSource, after `list` was called once by the constructor of the deriving class.
class ListedSource : public PatchSource {
 public:
  const MapHeader& header() const final { return header_; }
  Summary summary() const final { return summary_; }
  std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>& range = {}) const final;

 protected:
  /// The layers of a listed patch, sorted by type; `out` comes empty. Thread-safe.
  virtual void layers_of(PatchIndex patch, std::vector<LayerInfo>& out) const = 0;
  /// Sorts the patches by key and sums up; a patch `layers_of` finds no layer in is left out.
  void list(std::vector<PatchIndex> patches);

  MapHeader header_;

 private:
  class Cursor;
  std::vector<PatchIndex> patches_;
  Summary summary_;
};

/// A set of patches as a bitmap over a range that is known beforehand.
class PatchMarks {
 public:
  /// @throws Error{kLimit} if the range holds more than 2^22 patches
  explicit PatchMarks(const PatchRange& range);
  /// Marks all patches of `part`, which lies in the range.
  void mark(const PatchRange& part);
  /// @param max_memory_bytes  what listing the patches may take; 0: no bound
  std::vector<PatchIndex> marked(std::uint64_t max_memory_bytes = 0) const;

 private:
  PatchRange range_;
  std::int64_t width_ = 0;
  std::vector<bool> marks_;
};

}  // namespace apgm::converters
