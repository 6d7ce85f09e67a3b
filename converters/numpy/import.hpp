#pragma once

#include <memory>

#include "converters/common/settings.hpp"

namespace apgm::converters {

/// `FILE.json` beside `FILE.npy`.
std::string json_beside(const std::string& npy);

/// The values of the settings of a reading. @throws Error{kInvalidArgument|kLimit}
void check_array_import(const SettingsReader& settings);
/// Opens arrays as patches (Converter::open).
std::unique_ptr<PatchSource> import_arrays(const ReadRequest& request, const SettingsReader& settings);

}  // namespace apgm::converters
