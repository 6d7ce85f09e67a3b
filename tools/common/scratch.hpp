#pragma once

#include <string>

namespace apgm::tools {

/// Where files without a name lie that a writer of `output` needs: beside it, unless that is no file.
/// @throws Error{kOutput} if there is no directory for temporary files
std::string scratch_directory(const std::string& output);

}  // namespace apgm::tools
