#pragma once

#include <string>
#include <vector>

#include "apgm/core/source.hpp"

namespace apgm::tools {

/// A small picture of which patches exist, north up, in half-block characters: one line of text shows two
/// rows of patches, or of squares of patches where the map is too large for the space.
/// @return  lines of at most `columns` characters, at most `rows` lines; none for an empty map
std::vector<std::string> sketch(const PatchSource& source, std::size_t columns, std::size_t rows);

}  // namespace apgm::tools
