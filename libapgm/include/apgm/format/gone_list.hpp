#pragma once

#include <vector>

#include "apgm/core/map_changes.hpp"

namespace apgm {

/// The key of the list of what is gone, in the metadata of a message of changes.
inline constexpr const char* kGoneKey = "apgm.gone";

/// Puts what is gone into the metadata of a message of changes (docs/format.md, "Well-known metadata"),
/// instead of what is there.
/// @throws Error{kInvalidArgument} if `gone` is not in order, or of no type of the header; {kLimit} if it
/// does
///         not fit a header (some 500 000 layers)
void store_gone(const std::vector<MapChanges::Gone>& gone, MapHeader& header);

/// Takes it out of the metadata; empty where nothing is gone.
/// @throws Error{kDamaged} if it is malformed, not in order, or of no type of the header
std::vector<MapChanges::Gone> take_gone(MapHeader& header);

}  // namespace apgm
