#pragma once

#include <memory>
#include <string>
#include <vector>

#include "apgm/layouts/nonuniform_grid.hpp"
#include "apgm/layouts/submap_grid.hpp"

namespace apgm {

/// All that makes a layout but its cells, for files and tables.
struct LayoutDescription {
  std::string name;  ///< of layouts that move: "moving", "buerkle-A"; sub-maps take theirs from the container
  Frame frame;
  /// Of layouts that move with the vehicle; empty: sub-maps.
  std::vector<LayoutRectangle> rectangles;
  /// The snapped position that the rectangles lie round, in whole micrometres from the datum.
  std::int64_t vehicle_x_um = 0, vehicle_y_um = 0;
  SubMapContainer container = SubMapContainer::kDenseArray;
  double cell_m = 0;  ///< of sub-maps
  double horizon_m = 0;

  bool moves() const { return !rectangles.empty(); }
};

/// A layout of that description, all cells without data; sub-maps: without any.
/// @throws those of make_nonuniform_grid or make_submap_grid; {kInvalidArgument} for a position that is none
std::unique_ptr<Layout> make_layout(CellSchema schema, const LayoutDescription& description);

}  // namespace apgm
