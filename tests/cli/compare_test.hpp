#pragma once

#include <algorithm>
#include <sstream>

#include "cli_test.hpp"

namespace apgm::test {

class CompareCliTest : public CliTest {
 protected:
  Outcome compare(const std::vector<std::string>& arguments) const { return tool("compare", arguments); }
  Json document(std::vector<std::string> arguments) const {
    arguments.push_back("--json");
    const Outcome outcome = compare(arguments);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_EQ(outcome.err, "");
    return Json::parse(outcome.out, nullptr, false);
  }
  static Json layout(const Json& list, const std::string& name) {
    for (const Json& one : list) {
      if (one["layout"] == name) return one;
    }
    ADD_FAILURE() << "no layout " << name;
    return {};
  }

  /// Occupancy and the paper's semantics, which makes cells of 6 values; patches (-n, -n) to (n - 1, n - 1).
  Map paper_map(int n, int step) const {
    MapHeader header;
    header.types =
        TypeTable({LayerType::occupancy(), LayerType::semantic("semantics", {"Road", "Marking", "Blocked"})});
    Map map(header);
    for (int y = -n; y < n; ++y) {
      for (int x = -n; x < n; ++x) {
        Layer& layer = map.layer({x, y}, 0, step);
        std::ranges::fill(layer.plane(1), 0.5f);
        // Single occupied cells: what coarser cells change most.
        for (int i = 0; i < layer.side(); i += 8) {
          layer.at(0, {i, i}) = 0.75f;
          layer.at(1, {i, i}) = 0;
        }
      }
    }
    return map;
  }

  /// A vehicle that drives along x in a square room.
  static std::string log(int scans) {
    std::ostringstream text;
    for (int i = 0; i < scans; ++i) {
      text << "FLASER 61";
      for (int beam = 0; beam <= 60; ++beam) text << ' ' << 6 + beam % 5;
      text << ' ' << 0.05 * i << " 0 0 " << 0.05 * i << " 0 0 " << 100 + 0.1 * i << " host " << 0.1 * i
           << '\n';
    }
    return text.str();
  }
  static constexpr const char* kProfiles =
      "profiles:\n"
      "  - name: parking\n"
      "    from_s: 0\n"
      "    requirements:\n"
      "      - {layer: occupancy, horizon_m: 20, cell_m: 0.1}\n"
      "  - name: road\n"
      "    from_s: 2\n"
      "    requirements:\n"
      "      - {layer: occupancy, horizon_m: 40, cell_m: 0.2}\n";

  std::vector<std::string> lines(const std::string& name) const {
    std::vector<std::string> all;
    std::istringstream in(bytes(name));
    for (std::string line; std::getline(in, line);) all.push_back(line);
    return all;
  }
};

}  // namespace apgm::test
