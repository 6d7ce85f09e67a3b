#pragma once

#include <memory>
#include <vector>

#include "apgm/ops/merge.hpp"

namespace apgm {

/// A plan's decisions.
struct MergePlan::State {
  /// An input that holds patches, on the grid of the result.
  struct Lane {
    const PatchSource* source = nullptr;
    const PatchSource* sizes = nullptr;  ///< whose largest layers are those of `source`, told without a walk
    float alpha = 1.0f;
    std::string name;
    std::vector<TypeId> types;    ///< own id -> id in the result
    std::vector<bool> stored_ok;  ///< by own id: stored bytes mean the same in the result
  };

  MergeOptions options;
  MapHeader header;
  std::optional<int> required;  ///< r_req
  std::vector<Lane> lanes;      ///< in the order of the inputs
  std::vector<std::unique_ptr<PatchSource>> adapters;
  std::uint64_t plan_bytes = 0;   ///< memory the adapters take once they are used
  std::vector<Finding> findings;  ///< of the planning, told when the merge runs
};

namespace ops {

MergeReport run_merge(const MergePlan::State& plan, PatchSink& sink, const RunOptions& run);

}  // namespace ops
}  // namespace apgm
