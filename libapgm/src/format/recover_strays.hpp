#pragma once

#include <optional>

#include "recover_scan.hpp"

namespace apgm::format {

/// Marks what is whole in a file and yet seems to be of another one, whose pages got into it: a checksum does
/// not tell. What is marked counts only where a hash names it.
///
/// In a sealed file blocks are of commit 1, nothing lies behind a footer that says where it is, the map
/// header leads, and layers ascend by key and type. In an archive commits ascend, and none has a number that
/// the footers round it exclude. Where that does not hold, the longest run for which it does is taken for the
/// file's own.
/// @param archive  what the preamble says; nullopt if it is lost
void mark_strays(Salvage& salvage, const std::optional<bool>& archive);

}  // namespace apgm::format
