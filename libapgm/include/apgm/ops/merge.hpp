#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "apgm/core/source.hpp"
#include "apgm/fuse/combine.hpp"
#include "apgm/ops/run.hpp"

namespace apgm {

struct MergeInput {
  const PatchSource* source = nullptr;
  std::string name;    ///< for messages
  float alpha = 1.0f;  ///< trust in [0, 1]; below 1 every cell is discounted first
};

/// Receives the conflict K of fused cells, from one thread at a time, in key order, then by type. Only layers
/// that two or more inputs hold are reported.
class ConflictSink {
 public:
  virtual ~ConflictSink() = default;
  /// @param type  in the table of the merged map
  /// @param conflict  4^step values in [0, 1], rows of cells as in Layer
  virtual void put(PatchIndex patch, TypeId type, int step, std::span<const float> conflict) = 0;
};

struct MergeOptions {
  Rule rule = Rule::kDempster;
  std::optional<double> resolution_m;  ///< r_req from this cell size; empty: the finest present
  bool regrid = false;  ///< area-weighted regridding where frames differ by more than whole cells
  std::optional<std::string> assume_frame_id;  ///< take all inputs as being in this frame
  ConflictSink* conflict = nullptr;
  std::uint64_t max_memory_bytes = 0;  ///< what the plan of regridded inputs may take; 0: no bound
};

struct MergeReport {
  std::uint64_t patches = 0;
  std::uint64_t layers = 0;
  std::uint64_t layers_stored = 0;    ///< passed on as stored bytes
  std::uint64_t total_conflicts = 0;  ///< cells with K = 1 that became vacuous
};

/// The inputs brought to one frame and their common header, before any layer is read. The inputs' sources
/// must outlive the plan. Nothing but the sources' headers, summaries and content ids is read.
///
/// Frame. Inputs that hold patches vote; if none does, all do. The datum is the smallest (x, then y) among
/// the voters, so the result does not depend on the order of inputs. A voter whose datum differs from it by
/// whole cells of its coarsest layer is shifted exactly; where layers of several steps then share a target
/// patch, the finest step is kept and the coarser are split. With `regrid`, voters of another edge or at a
/// broken distance are regridded from their native cells; the edge is then the smallest among the voters. An
/// unknown EPSG code joins a known one (with a note when the merge runs); frame ids must be equal unless
/// `assume_frame_id`.
///
/// Types: fused_types() of all inputs, empty ones too. Metadata: pairs that all inputs share. Stamps: the
/// newest. History: that of the inputs where all are equal, else none, then one entry "merge" with the
/// content ids of all inputs, sorted (with Rule::kLast in their order; "unknown" where a source has none),
/// and the parameters rule, resolution_m, regrid, and discounts (in the order of the ids).
class MergePlan {
 public:
  /// @throws Error{kIncompatible} with a hint if edges, EPSG codes, frame ids or types do not fit together,
  /// or
  ///         the datums differ by other than whole cells and `regrid` is not set; {kInvalidArgument} on no
  ///         input, a trust outside [0, 1] or an unusable resolution; {kLimit} as Frame::step_for
  MergePlan(std::vector<MergeInput> inputs, MergeOptions options);
  ~MergePlan();
  MergePlan(MergePlan&&) noexcept;
  MergePlan& operator=(MergePlan&&) noexcept;

  const MapHeader& header() const;
  /// Streams the merged map to a sink made for header(). Layers that one input alone holds, fully trusted and
  /// no finer than required, pass as stored bytes. The caller calls PatchSink::finish.
  ///
  /// Guarantees: same parcels for any thread count and (kLast excepted) order of inputs; memory does not grow
  /// with the inputs where their datums are equal.
  /// @throws Error{kCancelled}, {kLimit} if the budget does not hold one patch, and whatever sources and sink
  /// throw
  MergeReport run(PatchSink& sink, const RunOptions& run = {}) const;

  struct State;  ///< private to the library

 private:
  std::unique_ptr<const State> state_;
};

}  // namespace apgm
