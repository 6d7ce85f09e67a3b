#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apgm/layouts/comparison.hpp"
#include "apgm/layouts/memory.hpp"
#include "apgm/layouts/nonuniform_grid.hpp"
#include "apgm/observe/profile.hpp"

namespace apgm::tools {

/// One way of storing a map, measured.
struct LayoutRow {
  std::string layout;       ///< "apgm", "buerkle-A", "submaps-hash_map", "moving"
  int values_per_cell = 0;  ///< 0: varies by layer
  Footprint footprint;
  std::optional<std::uint64_t> disk_bytes;
  std::optional<BeliefChange>
      change;  ///< of the cells of the map; nullopt: not asked for, or grids that do not fit
  std::optional<LayoutCost> cost;
};

struct CompareOptions {
  std::vector<NonUniformPlan> plans;  ///< non-uniform grids
  double finest_cell_m = 0;           ///< of sub-maps and the moving grid, which have one size for all
  double reach_m = 0;                 ///< half extent of the moving grid, at least
  bool disk = false;                  ///< bytes of files
  bool change = true;
  bool cost = false;
};

/// Presets A, B and C.
std::vector<NonUniformPlan> usual_plans();
/// Side of the finest cells of a map. @throws Error{kInvalidArgument} if it holds no layers
double finest_cell_m(const Map& map);

/// The finest cells that any profile asks for.
double finest_cell_m(const Schedule& schedule, const Frame& frame);
/// The farthest horizon of any profile; nullopt where all areas are polygons.
std::optional<double> farthest_m(const Schedule& schedule);

/// Puts the cells of `map` into each layout with the vehicle at `vehicle`; the map itself comes first.
/// Without costs the same rows on every machine.
/// @throws Error{kLimit} if a layout would be too large, {kInvalidArgument} on cells that are no whole
///         micrometres
std::vector<LayoutRow> compare_layouts(const Map& map, Point vehicle, const CompareOptions& options);

}  // namespace apgm::tools
