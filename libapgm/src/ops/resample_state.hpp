#pragma once

#include <memory>
#include <vector>

#include "apgm/ops/resample_map.hpp"

namespace apgm {

/// A plan's decisions.
struct ResamplePlan::State {
  ResampleOptions options;
  MapHeader header;
  std::optional<int> step;              ///< for every chosen layer, where no rule says it
  std::vector<bool> chosen;             ///< by type: to be resampled
  const PatchSource* source = nullptr;  ///< with the policies and the grid of the result
  std::vector<std::unique_ptr<PatchSource>> adapters;
  bool regridded = false;
  ResampleReport expected;
  std::uint64_t patches = 0;
  std::vector<std::uint64_t> largest;  ///< bytes by type, the greater of before and after

  /// Step of a layer in the result; nullopt: dropped.
  std::optional<int> wanted(const LayerInfo& layer) const {
    if (regridded || !chosen[layer.type]) return layer.step;
    if (options.rule) return options.rule(layer);
    return step.value_or(layer.step);
  }
};

namespace ops {

/// Counts a layer that is at `from` and becomes `to`, in `types`.
void tally(int from, std::optional<int> to, ResampleReport::OfType& type);

ResampleReport run_resample(const ResamplePlan::State& plan, PatchSink& sink, const RunOptions& run,
                            const std::function<void(const ResampledLayer&)>& watch);

}  // namespace ops
}  // namespace apgm
