#pragma once

#include "apgm/observe/model.hpp"
#include "apgm/observe/profile.hpp"
#include "tools/common/json.hpp"

namespace apgm::tools {

/// Parameters of the range sensor's model and its limits, as they stand in the history of a map.
Json models_json(const Models& models);
/// Profiles, when each begins, and what each requires.
Json schedule_json(const Schedule& schedule);

}  // namespace apgm::tools
