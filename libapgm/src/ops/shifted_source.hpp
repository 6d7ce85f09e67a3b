#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "apgm/core/source.hpp"
#include "apgm/core/working_memory.hpp"

namespace apgm::ops {

/// Distance between two datums in whole cells of one step.
struct CellOffset {
  int step = 0;
  std::int64_t x = 0;
  std::int64_t y = 0;
};

/// Where the datum of `from` lies, seen from that of `to`, in cells of `step`; empty if not a whole number.
/// Both frames have the same edge.
std::optional<CellOffset> whole_cells(const Frame& from, const Frame& to, int step);

/// A source seen from another datum, a whole number of its coarsest cells away: no value changes.
///
/// By whole patches layers keep their bytes and may pass as stored. By cells, a target layer is put together
/// from up to four source layers of its type; it takes the finest step among them, and those that are coarser
/// are split by the policy of the type. Layers may come out without data.
///
/// The Hilbert order of patches is not kept by a shift, so the layer infos of the source are held and sorted:
/// memory grows with the number of layers (about 50 bytes each), not of cells.
class ShiftedSource final : public PatchSource, public WorkingMemory {
 public:
  /// `target`: the frame to be seen in. @throws Error{kLimit} on use if patch indices leave their range
  ShiftedSource(const PatchSource& source, const Frame& target, const CellOffset& offset);

  const MapHeader& header() const override { return header_; }
  Summary summary() const override;
  std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>& range = {}) const override;
  void load(const LayerInfo& info, Layer& out) const override;
  bool load_stored(const LayerInfo& info, StoredLayer& out) const override;
  std::uint64_t working_bytes(std::uint64_t layer_bytes) const override;
  /// Memory of the layer infos, which are read on first use; known before that.
  std::uint64_t plan_bytes() const;

 private:
  friend class ShiftedCursor;
  /// A source patch that gives cells to a target patch.
  struct Part {
    std::uint64_t key;  ///< of the target
    PatchIndex target;
    std::uint32_t source;  ///< into Plan::patches
  };
  struct Plan {
    std::vector<LayerInfo> layers;     ///< of the source, patch after patch
    std::vector<std::size_t> patches;  ///< first layer of each source patch, and the end
    std::vector<Part> parts;           ///< sorted by key
    std::span<const LayerInfo> layers_of(std::uint32_t source) const {
      return {layers.data() + patches[source], layers.data() + patches[source + 1]};
    }
  };
  const Plan& plan() const;
  Plan make_plan() const;
  void reserve(Plan& plan) const;
  bool by_patches() const { return cells_x_ == 0 && cells_y_ == 0; }
  std::uint64_t parts_per_patch() const { return (cells_x_ != 0 ? 2u : 1u) * (cells_y_ != 0 ? 2u : 1u); }
  /// The target layers made of `parts`, sorted by type.
  void describe(std::span<const Part> parts, PatchInfo& out) const;
  /// Copies the part of `layer`, which lies in source patch `from`, that belongs to `target`.
  void place(const Layer& layer, PatchIndex from, PatchIndex target, Layer& out) const;

  const PatchSource& source_;
  MapHeader header_;
  std::int64_t patches_x_, patches_y_;  // whole patches of the offset
  std::int64_t cells_x_, cells_y_;      // and the cells left over, of step_, in [0, 2^step_)
  int step_;
  mutable std::once_flag planned_;
  mutable Plan plan_;
};

}  // namespace apgm::ops
