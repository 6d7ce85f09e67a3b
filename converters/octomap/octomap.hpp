#pragma once

#include "converters/common/converter.hpp"

namespace apgm::converters {

/// OctoMap trees of type OcTree, .bt and .ot (docs/converters.md).
const Converter& octomap();

}  // namespace apgm::converters
