#pragma once

#include <cstdint>
#include <functional>

#include "apgm/layouts/layout.hpp"

namespace apgm {

/// What the usual accesses to a layout cost, in nanoseconds of the given clock.
struct LayoutCost {
  double find_ns = 0;      ///< a find() at a random allocated cell
  double insert_ns = 0;    ///< an insert() there and writing all its values
  double grow_ns = 0;      ///< an insert() that makes a sub-map; 0 where nothing grows
  double shift_ns = 0;     ///< a move_to() of `step_m`
  double iterate_ns = 0;   ///< reading all values of a cell, cell after cell
  double snapshot_ns = 0;  ///< a snapshot()
};

struct CostOptions {
  int accesses = 20'000;  ///< find and insert
  int shifts = 8;
  int growths = 16;     ///< new sub-maps; each takes its memory
  double step_m = 0.5;  ///< 5 m/s at 10 Hz
  /// Monotonic nanoseconds; nullptr: std::chrono::steady_clock.
  std::function<std::int64_t()> now_ns;
};

/// Measures on snapshots: `layout` does not change. The same seed draws the same cells. Numbers depend on the
/// machine and its load, so they are no part of any result that must repeat.
/// @param vehicle  where the vehicle is; shifts start here and go along x
/// @throws Error{kInvalidArgument} if the layout has no cells or an option is below 1
LayoutCost measure_cost(const Layout& layout, Point vehicle, std::uint64_t seed,
                        const CostOptions& options = {});

}  // namespace apgm
