#pragma once

#include "converters/common/settings.hpp"

namespace apgm::converters {

/// The values of the settings of a writing. @throws Error{kInvalidArgument}
void check_array_export(const SettingsReader& settings);
/// Writes a map as .npz, or one layer as .npy with its JSON (Converter::write).
void export_arrays(const PatchSource& source, const WriteRequest& request, const SettingsReader& settings);

}  // namespace apgm::converters
