#pragma once

#include <string>

#include "apgm/core/map.hpp"

namespace apgm::samples {

/// Writes a whole map to an .apgm file, on one core.
/// @throws Error{kOutput} if the file exists (without `overwrite`) or cannot be written
void write_map(const Map& map, const std::string& path, bool overwrite = false);

}  // namespace apgm::samples
