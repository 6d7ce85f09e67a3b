#pragma once

#include <cstdint>

#include "apgm/layouts/cost.hpp"

namespace apgm {

/// How far a layout is from the map it was filled from. A cell of the map is looked at as the layout gives it
/// back: coarser cells are split, finer ones merged by the policy of the type. Its change is the greatest
/// |BetP(h) before - BetP(h) after| over the hypotheses h, in [0, 1]. Real channels do not count.
struct BeliefChange {
  std::uint64_t known_cells = 0;  ///< of the map, with data of evidence
  std::uint64_t lost_cells = 0;   ///< of these: the layout gives no data back
  double sum = 0;                 ///< of the changes of the others
  double most = 0;                ///< the greatest of them
  /// Occupancy: cells with BetP(O) > 0.5 that are given back, with BetP(O) <= 0.5.
  std::uint64_t obstacles = 0;

  double mean() const {
    return known_cells == lost_cells ? 0.0 : sum / static_cast<double>(known_cells - lost_cells);
  }
};

/// Equals what to_map() and resample() to the map's own steps give; summed in key order.
/// @throws those of to_map, {kIncompatible} if the layout lacks a type of the map
BeliefChange belief_change(const Layout& layout, const Map& map);

/// The same for a map that came back from another format: its layers at the map's own steps. Types are found
/// by name; cells of a type that it lacks are lost.
/// @throws Error{kIncompatible} if edges or datums differ, or a type of one name has other channels
BeliefChange belief_change(const Map& given_back, const Map& map);

/// As measure_cost of a layout, for an adaptive patched grid map: a find reads a value of every layer at a
/// place, an insert writes all values of a cell of one layer, growth makes a patch with a layer of the finest
/// step (grow_ns is 0 at the end of all indices). Moving costs nothing by itself (shift_ns is 0): what the
/// vehicle leaves is dropped by the Mapper.
/// @throws Error{kInvalidArgument} if the map has no cells or an option is below 1, {kLimit} beyond 4e9 m
LayoutCost measure_cost(const Map& map, std::uint64_t seed, const CostOptions& options = {});

}  // namespace apgm
