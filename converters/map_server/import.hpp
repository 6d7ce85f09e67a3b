#pragma once

#include <memory>

#include "converters/common/settings.hpp"

namespace apgm::converters {

/// Masses of trinary cells unless set. Not 1: Dempster's rule is undefined for two opposite certainties.
inline constexpr double kTrinaryMass = 0.9;

/// Opens a map as patches (Converter::open).
std::unique_ptr<PatchSource> import_map(const ReadRequest& request, const SettingsReader& settings);

}  // namespace apgm::converters
