#pragma once

#include "apgm/core/source.hpp"
#include "apgm/ops/statistics.hpp"  // totals_of

namespace apgm::ops {

/// Counts a layer in the totals of its type; `summary.types` has the size of `types`.
void add_layer(const LayerInfo& info, const TypeTable& types, Summary& summary);

}  // namespace apgm::ops
