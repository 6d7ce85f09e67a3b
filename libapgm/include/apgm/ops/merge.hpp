#pragma once

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

/// Receives the conflict K of fused cells, from one thread, in key order.
class ConflictSink {
 public:
  virtual ~ConflictSink() = default;
  virtual void put(PatchIndex patch, int step, std::span<const float> conflict) = 0;
};

struct MergeOptions {
  Rule rule = Rule::kDempster;
  std::optional<double> resolution_m;  ///< r_req from this cell size; empty: the finest present
  bool regrid = false;  ///< area-weighted regridding where frames differ by more than whole cells
  std::optional<std::string> assume_frame_id;  ///< take all inputs as being in this frame
  ConflictSink* conflict = nullptr;
};

struct MergeReport {
  std::uint64_t patches = 0;
  std::uint64_t layers = 0;
  std::uint64_t layers_stored = 0;    ///< passed on as stored bytes
  std::uint64_t total_conflicts = 0;  ///< cells with K = 1 that became vacuous
};

/// The inputs brought to one frame and their common header, before any layer is read.
///
/// The frame's datum is the smallest (x, then y) among the inputs that hold patches, so the result does not
/// depend on the order of inputs. Inputs whose datum differs from it by whole cells of their coarsest layer
/// are shifted exactly. Metadata: pairs that all inputs share. History: "merge" with the inputs' content ids,
/// sorted.
class MergePlan {
 public:
  /// @throws Error{kIncompatible} with a hint if edges, EPSG codes, frame ids or types do not fit together,
  /// or the
  ///         datums differ by other than whole cells and `regrid` is not set
  MergePlan(std::vector<MergeInput> inputs, MergeOptions options);
  ~MergePlan();
  const MapHeader& header() const;
  MergeReport run(PatchSink& sink, const RunOptions& run = {}) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace apgm
