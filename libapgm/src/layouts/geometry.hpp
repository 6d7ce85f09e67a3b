#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "apgm/layouts/layout.hpp"

namespace apgm::layouts {

/// Remainder of floor division, in [0, divisor).
constexpr std::int64_t floor_mod(std::int64_t value, std::int64_t divisor) {
  return value - floor_div(value, divisor) * divisor;
}

/// Whole micrometres from the datum.
struct Offset {
  std::int64_t x_um = 0, y_um = 0;
  friend bool operator==(const Offset&, const Offset&) = default;
};

/// The micrometre that holds `p`: since cells are whole micrometres, it lies in the same cell as `p`.
/// @throws Error{kInvalidArgument} if not finite, {kLimit} beyond 4e9 m
Offset offset_of(const Frame& frame, Point p);

/// A length as whole micrometres. @throws Error{kInvalidArgument} that begins with `what` if it is none
std::int64_t whole_um(double metres, const std::string& what);

/// Patches of `frame` that share area with `area`.
/// @throws Error{kLimit} if some lie outside all indices
PatchRange patches_in(const Frame& frame, const Area& area);

/// Columns [a0, a1) and rows [b0, b1) of a block.
struct CellWindow {
  int a0 = 0, a1 = 0, b0 = 0, b1 = 0;
};
/// The cells of `block` that share area with `area`.
CellWindow cells_in(const CellBlock& block, const Area& area);

/// Where a cell of a block begins, in floats.
inline std::int64_t position(const CellBlock& block, int values, int a, int b) {
  return b * block.row_stride + std::int64_t{a} * values;
}

/// What footprint() tells of the blocks; allocated_bytes are left to the layout.
Footprint count_cells(const Layout& layout);

}  // namespace apgm::layouts
