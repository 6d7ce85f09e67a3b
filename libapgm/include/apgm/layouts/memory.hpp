#pragma once

#include <cstdint>
#include <span>

#include "apgm/layouts/layout.hpp"

namespace apgm {

/// Cells that store a number of values each: a layer's, or a whole layout's.
struct CellCount {
  double cells = 0;  ///< may be a mean over time
  double values_per_cell = 0;
};

/// How many times the values of `adaptive` the layout `fixed` stores: the paper's memory factors (Sec. V),
/// values only. @throws Error{kInvalidArgument} if `adaptive` stores none
double memory_factor(CellCount fixed, std::span<const CellCount> adaptive);

/// Cells that sub-maps of one resolution need where an adaptive map has `cells`, `steps` resolution steps
/// coarser: 4^steps as many.
double cells_at_finer_step(double cells, int steps);

/// An adaptive patched grid map beside the layouts: cells of all layers, `known_cells` with data. A place
/// with two layers counts twice. `allocated_bytes` as in docs/layouts.md.
Footprint footprint(const Map& map);

}  // namespace apgm
