#pragma once

#include <cstdint>
#include <string>

#include "apgm/core/frame.hpp"

namespace apgm::tools {

/// "X,Y" in metres, each at most `most` from 0. @throws Error{kInvalidArgument} naming the option
Point parse_point(const std::string& option, const std::string& text, double most);

/// Metres as micrometres, of which they must be a whole number. @throws Error{kInvalidArgument}
std::int64_t whole_micrometres(const std::string& option, double metres);

}  // namespace apgm::tools
