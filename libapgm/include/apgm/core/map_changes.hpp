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
  std::vector<Gone> gone;  ///< by curve_key, then name
};

/// Brings `map`, as it was at the first look, to the second. Types are matched by name, new ones are added.
/// @throws Error{kIncompatible} if the frames differ or a type of one name stands for another space
void apply(const MapChanges& changes, Map& map);

}  // namespace apgm
