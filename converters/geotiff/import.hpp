#pragma once

#include <memory>

#include "converters/common/settings.hpp"

namespace apgm::converters {

/// Mass of a class unless set. Not 1: Dempster's rule is undefined for two opposite certainties.
inline constexpr double kClassMass = 0.9;

/// The values of the settings of a reading. @throws Error{kInvalidArgument|kLimit}
void check_raster_import(const SettingsReader& settings);
/// Opens a raster as patches (Converter::open).
std::unique_ptr<PatchSource> import_raster(const ReadRequest& request, const Converter& converter);

}  // namespace apgm::converters
