#pragma once

#include "apgm/core/layer.hpp"
#include "apgm/ops/resample_map.hpp"

namespace apgm::ops {

/// What `native` lost by becoming `out` (see ResampleLoss): both of `type`, `out` coarser or finer.
ResampleLoss measure_loss(const Layer& native, const LayerType& type, const Layer& out);

}  // namespace apgm::ops
