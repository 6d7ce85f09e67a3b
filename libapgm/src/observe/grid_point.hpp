#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>

#include "apgm/core/frame.hpp"

namespace apgm::observe {

/// A point in whole nanometres from the datum, rounded as Frame::cell_at does it.
struct GridPoint {
  std::int64_t x = 0;
  std::int64_t y = 0;
};

inline std::int64_t edge_nm(const Frame& frame) { return frame.edge_um * 1000; }
inline std::int64_t nanometres(double metres) { return std::llrint(metres * 1e9); }

inline bool is_finite(Point p) { return std::isfinite(p.x_m) && std::isfinite(p.y_m); }

/// Key of a patch for hashing.
inline std::uint64_t patch_key(PatchIndex p) {
  return std::uint64_t{static_cast<std::uint32_t>(p.x)} << 32 | static_cast<std::uint32_t>(p.y);
}

/// nullopt if `p` is not finite or lies outside all patches.
inline std::optional<GridPoint> grid_point(const Frame& frame, Point p) {
  constexpr double kMaxCoordinate_m = 4e9;
  if (!(std::fabs(p.x_m) <= kMaxCoordinate_m) || !(std::fabs(p.y_m) <= kMaxCoordinate_m)) return {};
  const GridPoint g{nanometres(p.x_m) - frame.datum_x_um * 1000, nanometres(p.y_m) - frame.datum_y_um * 1000};
  const auto is_index = [&](std::int64_t nm) {
    const std::int64_t i = floor_div(nm, edge_nm(frame));
    return i >= std::numeric_limits<std::int32_t>::min() && i <= std::numeric_limits<std::int32_t>::max();
  };
  if (!is_index(g.x) || !is_index(g.y)) return {};
  return g;
}

}  // namespace apgm::observe
