#pragma once

#include "converters/common/settings.hpp"

namespace apgm::converters {

/// Writes the occupancy layers of a map as an octree (Converter::write).
void export_octree(const PatchSource& source, const WriteRequest& request, const SettingsReader& settings);

}  // namespace apgm::converters
