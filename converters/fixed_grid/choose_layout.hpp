#pragma once

#include <memory>

#include "apgm/layouts/layout.hpp"
#include "converters/common/settings.hpp"

namespace apgm::converters {

std::vector<SettingSpec> layout_settings();
/// Checks the settings as far as that goes without a map.
void check_layout_settings(const SettingsReader& settings);
/// The layout that the settings name, at the vehicle's place, without data.
/// @param map  its types, its frame, and where settings are missing its middle and its finest cells
/// @throws over_budget() before cells are made, if they and what packs them do not fit; 0: no bound
std::unique_ptr<Layout> choose_layout(const SettingsReader& settings, const PatchSource& map,
                                      std::uint64_t max_memory_bytes = 0);
/// Side of the finest cells of a map; of a patch if there are none.
double finest_cell_m(const PatchSource& map);
/// Middle of its patches; the datum if there are none.
Point middle_of(const PatchSource& map);
/// Where the settings or the map's middle put the vehicle.
Point vehicle_of(const SettingsReader& settings, const PatchSource& map);

}  // namespace apgm::converters
