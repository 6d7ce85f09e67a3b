#pragma once

#include "converters/common/converter.hpp"

namespace apgm::converters {

/// Fixed layouts of cells (docs/layouts.md), for comparing bytes on disk.
const Converter& fixed_grid();

}  // namespace apgm::converters
