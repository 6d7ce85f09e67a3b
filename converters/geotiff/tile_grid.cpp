#include "converters/geotiff/tile_grid.hpp"

#include <limits>
#include <string>

#include "apgm/core/error.hpp"

namespace apgm::converters {

TileGrid TileGrid::of(const PatchSource& source, TypeId type, int step, const RunOptions& run) {
  TileGrid grid;
  const auto cursor = source.patches();
  PatchInfo patch;
  while (cursor->next(patch)) {
    for (const LayerInfo& info : patch.layers) {
      if (info.type == type) grid.range.add(info.patch);
    }
  }
  if (grid.range.empty()) {
    grid.range = {{0, 0}, {0, 0}};
    if (run.findings) {
      run.findings({Finding::Kind::kWarning, "the layer has no known cells: the raster is one empty patch"});
    }
  }
  constexpr std::int64_t kLeastTile = 128, kLargestTile = 512, kMostTiles = std::int64_t{1} << 22;
  grid.step = step;
  grid.side = std::int64_t{1} << step;
  grid.tile = static_cast<int>(std::clamp(grid.side, kLeastTile, kLargestTile));
  grid.unit = std::max<std::int64_t>(grid.tile, grid.side);
  grid.width = (std::int64_t{grid.range.max.x} - grid.range.min.x + 1) * grid.side;
  grid.height = (std::int64_t{grid.range.max.y} - grid.range.min.y + 1) * grid.side;
  const auto tiles = [&](std::int64_t pixels) { return (pixels + grid.tile - 1) / grid.tile; };
  if (std::max(grid.width, grid.height) > std::numeric_limits<std::int32_t>::max() ||
      tiles(grid.width) > kMostTiles / tiles(grid.height)) {
    throw Error(ErrorCode::kLimit, "the raster would have " + std::to_string(grid.width) + " x " +
                                       std::to_string(grid.height) + " pixels, more than 2^22 tiles")
        .hint("crop the map, or set a coarser step");
  }
  return grid;
}

}  // namespace apgm::converters
