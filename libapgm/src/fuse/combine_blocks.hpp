#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "apgm/fuse/combine.hpp"
#include "fuse/cells.hpp"

namespace apgm::fuse {

/// Memory that combining more than two inputs, or other types than occupancy, needs; kept from call to call.
struct CombineScratch {
  std::vector<float> rows;
  std::vector<std::int32_t> holds;
};

/// combine() for any type, number of inputs and rule, a block of cells at a time. Each cell of `out` depends
/// on the same cell of the inputs alone, and `out` may be one of them.
/// @return cells of total conflict
std::uint64_t combine_blocks(std::span<const ConstCells> inputs, const LayerType& type, Rule rule,
                             const Cells& out, std::size_t cells, float* conflict, CombineScratch& scratch);

/// The fastest way for these inputs: a copy, the kernel of two occupancies, or blocks.
std::uint64_t combine_cells(std::span<const ConstCells> inputs, const LayerType& type, Rule rule,
                            const Cells& out, std::size_t cells, float* conflict, CombineScratch& scratch);

/// Discounts cells in place; `alpha` lies in [0, 1].
void discount_cells(const Cells& cells, const LayerType& type, float alpha, std::size_t count);

}  // namespace apgm::fuse
