#pragma once

#include <string>

#include "apgm/core/map.hpp"

namespace apgm::samples {

/// Refuses before the work, not after it.
/// @throws Error{kOutput} if there is something at `path`
void check_absent(const std::string& path);

/// Writes a whole map to an .apgm file, on one core.
/// @throws Error{kOutput} if the file exists (without `overwrite`) or cannot be written
void write_map(const Map& map, const std::string& path, bool overwrite = false);

}  // namespace apgm::samples
