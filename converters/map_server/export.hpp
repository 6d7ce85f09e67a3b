#pragma once

#include "converters/common/settings.hpp"

namespace apgm::converters {

/// The values of the settings of a writing, as far as they can be told without the map.
/// @throws Error{kInvalidArgument}
void check_export_settings(const SettingsReader& settings);
/// The YAML and its picture (Converter::files_written).
std::vector<std::string> exported_files(const MapHeader& header, const WriteRequest& request,
                                        const SettingsReader& settings);
/// To replace a map is to replace its YAML and the picture that names; any other picture is not this map's.
/// @throws Error{kOutput} if `picture` exists and must not be replaced
void check_picture(const std::string& yaml, const std::string& picture, const OutputOptions& output);
/// Writes an occupancy layer of a map as YAML and picture (Converter::write).
void export_map(const PatchSource& source, const WriteRequest& request, const SettingsReader& settings);

}  // namespace apgm::converters
