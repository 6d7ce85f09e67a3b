#pragma once

#include <array>
#include <optional>
#include <string_view>

#include "apgm/layouts/layout.hpp"

namespace apgm {

/// Where the sub-maps of a sub-map grid are kept (Wellhausen et al. 2021).
enum class SubMapContainer : std::uint8_t {
  kDenseArray,    ///< a pointer for every sub-map of the bounding box
  kHashMap,       ///< by index
  kQuadtree,      ///< four children a node, as deep as the extent needs
  kSortedVector,  ///< sorted by index, binary search
  kCowTiles,      ///< sorted; tiles shared with snapshots, copied when written to
};
inline constexpr std::array kSubMapContainers{SubMapContainer::kDenseArray, SubMapContainer::kHashMap,
                                              SubMapContainer::kQuadtree, SubMapContainer::kSortedVector,
                                              SubMapContainer::kCowTiles};
/// Name in snake_case: "dense_array".
std::string_view to_string(SubMapContainer container);
std::optional<SubMapContainer> submap_container_from(std::string_view name);

/// Sub-maps (the patches of `frame`) of one cell size, each with all values of all its cells; made on demand.
/// @param cell_m     edge / 2^r, whole micrometres
/// @param horizon_m  sub-maps whose square does not meet this disc round the vehicle are dropped when it
///                   moves; 0: none is
/// @throws Error{kInvalidArgument|kLimit}
std::unique_ptr<Layout> make_submap_grid(CellSchema schema, const Frame& frame, double cell_m,
                                         SubMapContainer container, double horizon_m = 0);

}  // namespace apgm
