#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "apgm/core/source.hpp"
#include "converters/common/settings.hpp"

namespace apgm::converters {

/// A foreign grid of square cells: cell (0, 0) has its lower-left corner at the origin, and the grid is
/// turned about it by `yaw_rad`.
struct ForeignGrid {
  double cell_m = 0;
  Point origin_m;
  double yaw_rad = 0;
};

/// How a foreign grid becomes patches.
struct GridFit {
  Frame native;  ///< its cells of step `step` are the grid's own, unturned
  int step = 0;
  std::int64_t offset_x =
      0;  ///< grid cell (i, j) is cell (i + offset_x, j + offset_y) counted from the datum
  std::int64_t offset_y = 0;
  std::optional<Frame> target;  ///< set: the map has another edge, datum or yaw, and is regridded to this

  /// Patch and cell of the grid cell (i, j). @throws Error{kLimit} outside all patch indices
  Frame::Cell cell_at(std::int64_t i, std::int64_t j) const;
};

/// Fits patches to a grid: the edge is cell_m * 2^r nearest 12.8 m (the smaller of two as near) and the datum
/// the origin, unless the settings `edge_m` and `datum` say otherwise. An edge that is another cell_m * 2^r,
/// or a datum a whole number of cells away, keeps the cells; anything else, and a yaw, sets `target`. Takes
/// frame_id and epsg along. A cell size or an origin that is no whole number of micrometres is a kNote
/// finding.
/// @throws Error{kInvalidArgument|kLimit} on settings or sizes that cannot be used
GridFit fit_grid(const ForeignGrid& grid, const SettingsReader& settings, const Findings& findings);

/// `native` as it is, or regridded to `fit.target` by area weights; owns what it needs. Regridding
/// cells is a kLoss finding.
/// @param max_memory_bytes  what is left for the regridding to keep; 0: no bound
std::unique_ptr<PatchSource> place(std::unique_ptr<PatchSource> native, const ForeignGrid& grid,
                                   const GridFit& fit, const Findings& findings,
                                   std::uint64_t max_memory_bytes = 0);

}  // namespace apgm::converters
