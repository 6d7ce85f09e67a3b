#pragma once

#include <cstdint>
#include <vector>

#include "apgm/layouts/layout.hpp"

namespace apgm::converters {

/// What becomes of the cells of a map's type that hold data. A cell is where its centre is.
struct CellFates {
  std::uint64_t known = 0;
  std::uint64_t outside = 0;  ///< lie outside the layout: lost
  std::uint64_t merged = 0;   ///< go into a larger cell of the layout
  std::uint64_t split = 0;    ///< become several
};

/// By type of the map, for a layout that was filled from it.
std::vector<CellFates> cell_fates(const Layout& layout, const PatchSource& map);

/// By type: cells of the layout with data that became several in to_map(), because finer ones share their
/// patch or they are not square.
std::vector<std::uint64_t> cells_split(const Layout& layout, const Map& map);

}  // namespace apgm::converters
