#pragma once

#include <string>
#include <vector>

#include "apgm/core/map.hpp"

namespace apgm {

/// What changed in a map between two looks: the layers that differ, whole, and what is gone.
struct MapChanges {
  Map changed;
  struct Gone {
    PatchIndex patch;
    std::string layer;
    friend bool operator==(const Gone&, const Gone&) = default;
  };
  std::vector<Gone> gone;  ///< by curve_key, then name; none of it is in `changed`
};

/// Brings `map`, as it was at the first look, to the second: same layers, cells and stamps. Types are matched
/// by name, new ones are added; of a type in both the resampling policy is that of the changes. What is gone
/// may be missing.
/// @throws Error{kIncompatible} if the frames differ or a type of one name stands for another space; `map` is
///         then unchanged
void apply(const MapChanges& changes, Map& map);

}  // namespace apgm
