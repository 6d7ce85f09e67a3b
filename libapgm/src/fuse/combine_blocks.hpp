#pragma once

#include <cstdint>
#include <span>

#include "apgm/core/layer.hpp"
#include "apgm/fuse/combine.hpp"

namespace apgm::fuse {

/// combine() for any type, number of inputs and rule, a block of cells at a time; `out` has its shape
/// already.
/// @return cells of total conflict
std::uint64_t combine_blocks(std::span<const Layer* const> inputs, const LayerType& type, Rule rule,
                             Layer& out, float* conflict);

}  // namespace apgm::fuse
