#pragma once

#include <span>

#include "apgm/core/layer.hpp"
#include "fuse/cells.hpp"

namespace apgm::fuse {

/// Cells [first, first + count) of a layer of `step`, coarser than `in`, that are to be merged from it.
struct CoarseCells {
  const Layer& in;
  int step = 0;
  std::size_t first = 0;
  std::size_t count = 0;
};

/// Merges from the native level in one step: policies that are not a 2x2 of rows. Cell `first` goes to
/// out[channel][0].
void merge_evidence(const CoarseCells& cells, const LayerType& type, std::span<float* const> out);
void merge_median(const CoarseCells& cells, std::span<float* const> out);
void merge_dempster(const CoarseCells& cells, std::span<float* const> out);
/// kMean, kSum, kMinimum, kMaximum: in each channel over the cells with a number.
void merge_pool(const CoarseCells& cells, const LayerType& type, std::span<float* const> out);

/// m(Omega) of each part of `count` cells by square roots, the shares of the classes kept.
void split_evidence(const ConstCells& in, const LayerType& type, int levels, const Cells& out,
                    std::size_t count);

}  // namespace apgm::fuse
