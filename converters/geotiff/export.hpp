#pragma once

#include <string>
#include <vector>

#include "converters/common/settings.hpp"

namespace apgm::converters {

/// The values of the settings of a writing, as far as they can be told without the map.
/// @throws Error{kInvalidArgument}
void check_raster_export(const SettingsReader& settings);
/// The GeoTIFF, and with mode=classes the file of GDAL beside it that names the classes.
std::vector<std::string> raster_files(const WriteRequest& request, const SettingsReader& settings);
/// GDAL reads FILE.tif.aux.xml with FILE.tif, whatever wrote it: one that is there is the old raster's.
/// @throws Error{kOutput} if it exists and must not be replaced
void check_side_file(const WriteRequest& request);
/// Writes a layer of a map as GeoTIFF (Converter::write).
void export_raster(const PatchSource& source, const WriteRequest& request, const SettingsReader& settings);

}  // namespace apgm::converters
