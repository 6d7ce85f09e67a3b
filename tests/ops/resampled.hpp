#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "apgm/ops/resample_map.hpp"
#include "random_map.hpp"
#include "stored_map.hpp"

namespace apgm::test {

struct Resampled {
  Map map;
  ResampleReport report;
};

inline Resampled resample_map(const PatchSource& source, const ResampleOptions& options,
                              const RunOptions& run = {},
                              const std::function<void(const ResampledLayer&)>& watch = {}) {
  const ResamplePlan plan(source, options);
  Map map(plan.header());
  StoredSink sink(map);
  const ResampleReport report = plan.run(sink, run, watch);
  return {std::move(map), report};
}

inline ResampleOptions to_step(int step) {
  ResampleOptions options;
  options.step = step;
  return options;
}

inline RunOptions threads(int n) {
  RunOptions run;
  run.threads = n;
  return run;
}

/// Types of every policy.
inline std::vector<LayerType> all_types() {
  std::vector<LayerType> types;
  for (const Policy policy : {Policy::kExclusive, Policy::kConditional, Policy::kMin, Policy::kProduct,
                              Policy::kMedian, Policy::kDempster, Policy::kMean}) {
    types.push_back(LayerType::occupancy("occ_" + std::string(to_string(policy)), policy));
  }
  for (const Policy policy : {Policy::kEvidence, Policy::kMean}) {
    types.push_back(LayerType::semantic("sem_" + std::string(to_string(policy)), {"a", "b", "c"}, policy));
  }
  for (const Policy policy : {Policy::kMean, Policy::kSum, Policy::kMinimum, Policy::kMaximum}) {
    types.push_back(LayerType::real("real_" + std::string(to_string(policy)), {"x", "y"}, policy));
  }
  return types;
}

inline Map every_type(std::uint64_t seed) {
  RandomMapOptions options;
  options.types = all_types();
  options.range = {{-2, -2}, {1, 1}};
  return random_map(seed, options);
}

/// One patch (0,0) with one layer of `type` at step 1: cells (0,0), (1,0), (0,1), (1,1).
inline Map four_cells(const LayerType& type, const std::vector<std::vector<float>>& cells) {
  MapHeader header;
  header.types = TypeTable({type});
  Map map(header);
  Layer& layer = map.layer({0, 0}, 0, 1);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    for (std::size_t c = 0; c < cells[i].size(); ++c) layer.plane(static_cast<int>(c))[i] = cells[i][c];
  }
  return map;
}

}  // namespace apgm::test
