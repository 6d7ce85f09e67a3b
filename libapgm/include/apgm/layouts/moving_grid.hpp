#pragma once

#include "apgm/layouts/layout.hpp"

namespace apgm {

/// The classic grid that moves with the vehicle: one dense square of equal cells in a ring buffer; moving
/// clears the rows and columns that enter. Starts round the datum; the vehicle's position is taken to the
/// nearest multiple of `cell_m`.
/// @param cell_m         side of a cell, whole micrometres
/// @param half_extent_m  to each side of the vehicle, a whole number of cells
/// @throws Error{kInvalidArgument|kLimit}
std::unique_ptr<Layout> make_moving_grid(CellSchema schema, const Frame& frame, double cell_m,
                                         double half_extent_m);

}  // namespace apgm
