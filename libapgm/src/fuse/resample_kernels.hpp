#pragma once

#include <cstddef>

#include "apgm/core/layer_type.hpp"

namespace apgm::fuse {

/// Two neighbouring rows of an occupancy layer, 2 n cells each.
struct RowPair {
  const float* o[2];
  const float* f[2];
};

/// True for the policies that merge 2x2 by merge_rows, level by level.
constexpr bool merges_by_rows(Policy policy) {
  return policy == Policy::kExclusive || policy == Policy::kConditional || policy == Policy::kMin ||
         policy == Policy::kProduct;
}

/// Merges 2x2 cells of `rows` row pairs that follow each other into rows of n cells that do so too
/// (docs/theory.md, "Resampling occupancy").
void merge_rows(Policy policy, const RowPair& in, float* o, float* f, std::size_t n, std::size_t rows);

/// The value of each of the 4^levels cells that a cell splits into, for n cells. Occupancy policies but
/// kDempster, which copies.
void split_cells(Policy policy, int levels, const float* o, const float* f, float* out_o, float* out_f,
                 std::size_t n);

/// Each of `n` values 2^levels times, side by side; levels >= 1.
void spread_row(const float* from, int levels, float* to, std::size_t n);

}  // namespace apgm::fuse
