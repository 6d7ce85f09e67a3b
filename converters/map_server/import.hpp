#pragma once

#include <memory>

#include "converters/common/settings.hpp"

namespace apgm::converters {

/// Masses of trinary cells unless set. Not 1: Dempster's rule is undefined for two opposite certainties.
inline constexpr double kTrinaryMass = 0.9;

/// The values of the settings of a reading. @throws Error{kInvalidArgument|kLimit}
void check_import_settings(const SettingsReader& settings);
/// Opens a map as patches (Converter::open).
std::unique_ptr<PatchSource> import_map(const ReadRequest& request, const SettingsReader& settings);

}  // namespace apgm::converters
