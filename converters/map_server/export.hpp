#pragma once

#include "converters/common/settings.hpp"

namespace apgm::converters {

/// Writes an occupancy layer of a map as YAML and picture (Converter::write).
void export_map(const PatchSource& source, const WriteRequest& request, const SettingsReader& settings);

}  // namespace apgm::converters
