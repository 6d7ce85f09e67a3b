#pragma once

#include "apgm/core/layer.hpp"

namespace apgm::fuse {

/// Merges from the native level in one step: policies that are not a 2x2 of rows. `out` has its shape
/// already, coarser than `in`.
void merge_evidence(const Layer& in, const LayerType& type, Layer& out);
void merge_median(const Layer& in, Layer& out);
void merge_dempster(const Layer& in, Layer& out);
/// kMean, kSum, kMinimum, kMaximum: in each channel over the cells with a number.
void merge_pool(const Layer& in, const LayerType& type, Layer& out);

/// m(Omega) of a cell by square roots, the shares of the classes kept. `out` has the shape of `in`.
void split_evidence(const Layer& in, const LayerType& type, int levels, Layer& out);

}  // namespace apgm::fuse
