#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>

#include "apgm/core/source.hpp"
#include "apgm/ops/run.hpp"

namespace apgm::converters {

/// The raster of a layer: whole patches, from the north-west corner of their range. Tiles and patches are
/// squares of powers of two; a unit is the larger of both, so that a unit holds whole tiles and whole
/// patches.
struct TileGrid {
  PatchRange range;
  int step = 0;
  std::int64_t width = 0, height = 0;  ///< pixels
  std::int64_t side = 0;               ///< of a patch, pixels
  int tile = 0;
  std::int64_t unit = 0;

  /// The patches that have the type; one patch (0, 0) for none, with a kWarning finding.
  /// @throws Error{kLimit} on more than 2^31 - 1 pixels a side or 2^22 tiles
  static TileGrid of(const PatchSource& source, TypeId type, int step, const RunOptions& run);

  std::int64_t unit_rows() const { return (height + unit - 1) / unit; }
  std::int64_t unit_column(PatchIndex patch) const {
    return (std::int64_t{patch.x} - range.min.x) * side / unit;
  }
  PatchRange patches_of_row(std::int64_t row) const {
    const std::int64_t patches = unit / side, top = std::int64_t{range.max.y} - row * patches;
    const std::int64_t bottom = std::max<std::int64_t>(top - patches + 1, range.min.y);
    return {{range.min.x, static_cast<std::int32_t>(bottom)}, {range.max.x, static_cast<std::int32_t>(top)}};
  }
  /// Pixels from the unit's north-west corner to the patch's.
  std::pair<std::int64_t, std::int64_t> place_in_unit(PatchIndex patch) const {
    return {(std::int64_t{patch.x} - range.min.x) * side % unit,
            (std::int64_t{range.max.y} - patch.y) * side % unit};
  }
};

}  // namespace apgm::converters
