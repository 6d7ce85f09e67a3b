#include "peer.hpp"

#include <cstdlib>

#include "samples/support/program.hpp"

namespace apgm::bench {

int take_runs(std::vector<std::string>& args) {
  const std::string text = samples::take_option(args, "--runs");
  if (text.empty()) return 5;
  char* end = nullptr;
  const long runs = std::strtol(text.c_str(), &end, 10);
  if (*end != '\0' || runs < 1 || runs > 1000) {
    throw samples::UsageError{"'" + text + "' is not a number of runs"};
  }
  return static_cast<int>(runs);
}

std::array<double, 4> parse_box(const std::string& text) {
  std::array<double, 4> box{};
  const char* at = text.c_str();
  for (std::size_t i = 0; i < 4; ++i) {
    char* end = nullptr;
    box[i] = std::strtod(at, &end);
    if (end == at || *end != (i < 3 ? ',' : '\0')) throw samples::UsageError{"'" + text + "' is not a box"};
    at = end + 1;
  }
  return box;
}

}  // namespace apgm::bench
