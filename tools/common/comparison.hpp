#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apgm/layouts/comparison.hpp"
#include "apgm/layouts/memory.hpp"
#include "apgm/layouts/nonuniform_grid.hpp"
#include "apgm/observe/profile.hpp"
#include "apgm/ops/run.hpp"
#include "tools/common/memory.hpp"

namespace apgm::tools {

/// One way of storing a map, measured.
struct LayoutRow {
  std::string layout;       ///< "apgm", "buerkle-A", "submaps-hash_map", "moving", "geotiff"
  bool in_memory = true;    ///< false: a file alone, the footprint says nothing
  int values_per_cell = 0;  ///< 0: varies by layer
  Footprint footprint;
  std::optional<std::uint64_t> disk_bytes;
  std::optional<BeliefChange>
      change;  ///< of the cells of the map; nullopt: not asked for, or grids that do not fit
  std::optional<LayoutCost> cost;  ///< in a drive shift_ns is the mean of the moves since the last row
  std::uint64_t shifts = 0;        ///< of layouts that move: how often they did since the last row
  std::string note;                ///< why figures are missing
};

struct CompareOptions {
  std::vector<NonUniformPlan> plans;  ///< non-uniform grids
  double finest_cell_m = 0;           ///< of sub-maps and the moving grid, which have one size for all
  double reach_m = 0;                 ///< half extent of the moving grid, at least
  bool disk = false;                  ///< bytes of files
  bool change = true;
  bool cost = false;
  bool foreign = true;     ///< rows of OctoMap, GeoTIFF and NumPy, where `disk` is set
  MemoryLeft memory_left;  ///< what rows may take beside the map
  RunOptions run;          ///< its threads and cancellation
};

/// Presets A, B and C.
std::vector<NonUniformPlan> usual_plans();
/// The finest cells that any profile asks for.
double finest_cell_m(const Schedule& schedule, const Frame& frame);
/// The farthest horizon of any profile; nullopt where all areas are polygons.
std::optional<double> farthest_m(const Schedule& schedule);

/// Checks, before a map is read, that it and all layouts beside it find room.
/// @throws over_budget()
void check_memory(const PatchSource& map, const CompareOptions& options);

/// A map or a drive beside the layouts. Those that move are made once and travel with the vehicle: they shift
/// in snapped steps, cells that enter are filled from the map, and what the map holds is brought in again
/// before rows are made. What the map dropped stays in them until it leaves. Sub-maps are the map's own
/// patches, made anew for each row.
class LayoutComparison {
 public:
  /// @throws Error{kLimit} if a layout would be too large, {kInvalidArgument} on cells that are no whole
  ///         micrometres
  LayoutComparison(const Map& map, const CompareOptions& options);
  ~LayoutComparison();
  LayoutComparison(const LayoutComparison&) = delete;
  LayoutComparison& operator=(const LayoutComparison&) = delete;

  /// The vehicle is here. @param map  nullptr: cells that enter stay without data until the next rows
  void move_to(Point vehicle, const Map* map);
  /// Rows where the vehicle is; the map itself comes first, with the types it had at first. Without costs the
  /// same rows on every machine. @throws Error{kLimit} if that would take more than the budget
  std::vector<LayoutRow> rows(const Map& map);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The rows of a map with the vehicle at `vehicle`. @throws those of LayoutComparison
std::vector<LayoutRow> compare_layouts(const Map& map, Point vehicle, const CompareOptions& options);

}  // namespace apgm::tools
