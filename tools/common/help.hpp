#pragma once

#include <string>

#include "tools/common/app.hpp"

namespace apgm::tools {

/// The text of --help: usage, details, options by group, examples, exit codes. At most 100 columns.
std::string help_text(const ToolInfo& info, const CLI::App& app);

/// Breaks `text` at spaces so that no line is longer than `width`; lines but the first start with `indent`
/// spaces.
std::string wrap(const std::string& text, std::size_t width, std::size_t indent);

}  // namespace apgm::tools
