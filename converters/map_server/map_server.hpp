#pragma once

#include "converters/common/converter.hpp"

namespace apgm::converters {

/// Maps of the nav2 map_server: a YAML file and a PGM or PNG picture beside it (docs/converters.md).
const Converter& map_server();

}  // namespace apgm::converters
