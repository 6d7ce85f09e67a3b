#include "tools/common/grid.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "tools/common/exit_code.hpp"
#include "tools/common/json.hpp"
#include "tools/common/parse.hpp"

namespace apgm::tools {

Point parse_point(const std::string& option, const std::string& text, double most) {
  const std::size_t comma = text.find(',');
  if (comma == std::string::npos || text.find(',', comma + 1) != std::string::npos) {
    throw usage_error(fmt::format("{} takes 2 numbers X,Y, not '{}'", option, text));
  }
  return {parse_real(option, std::string_view(text).substr(0, comma), -most, most),
          parse_real(option, std::string_view(text).substr(comma + 1), -most, most)};
}

std::int64_t whole_micrometres(const std::string& option, double metres) {
  const std::int64_t um = to_micrometres(metres);
  const double rounding = std::max(1e-3, std::fabs(metres) * 1e-9);  // of a decimal number in a double
  if (std::fabs(metres * 1e6 - static_cast<double>(um)) <= rounding) return um;
  throw usage_error(fmt::format("{} takes whole micrometres: {} m is none", option, number_text(metres)));
}

}  // namespace apgm::tools
