#pragma once

#include <functional>

#include "apgm/core/map.hpp"
#include "apgm/layouts/description.hpp"

namespace apgm::converters {

/// The cells of a layout as a map whose coordinates are cell numbers: rectangles one above the other in
/// patches of 128 x 128 cells, each from a new row of patches on; sub-maps as patches of their index.
class LayoutRaster {
 public:
  explicit LayoutRaster(const LayoutDescription& layout);

  /// Of a map for the cells; its lengths mean nothing.
  MapHeader header(const TypeTable& types) const;
  Map from_layout(const Layout& layout) const;
  /// @throws Error{kDamaged} if the map holds what is no cell of the layout
  void to_layout(const Map& map, Layout& layout) const;

 private:
  /// A part of a block within one patch of the raster.
  struct Part {
    PatchIndex patch;
    int a = 0, b = 0;              // in the patch
    int block_a = 0, block_b = 0;  // in the block
    int columns = 0, rows = 0;
  };
  struct Placed {
    std::int64_t x_um = 0, y_um = 0, x1_um = 0, y1_um = 0;  // of a rectangle, in the map's CRS
    std::int64_t first_row = 0;
  };
  void visit_parts(const CellBlock& block, const std::function<void(const Part&)>& visit) const;

  Frame frame_;
  int step_ = 7;
  std::vector<Placed> rectangles_;
};

}  // namespace apgm::converters
