#pragma once

#include <cstddef>
#include <string>

#include "apgm/ops/diff.hpp"
#include "tools/common/json.hpp"

namespace apgm::tools {

/// "bytes", "cells", "belief"
std::string to_string(DiffLevel level);

/// Members of the document of apgm-diff: equal, patches, layers, header_differences, and regions where `top`
/// is not 0.
/// @param level  kBytes leaves out what is known of cells alone
Json diff_json(const DiffReport& report, DiffLevel level, std::size_t top);

/// The same for people, lines of text.
std::string diff_text(const DiffReport& report, DiffLevel level, std::size_t top);

}  // namespace apgm::tools
