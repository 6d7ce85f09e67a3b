#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "apgm/core/map.hpp"
#include "apgm/format/writer.hpp"
#include "apgm/ops/copy.hpp"
#include "process.hpp"
#include "random_map.hpp"
#include "temp_dir.hpp"

namespace apgm::test {

using Json = nlohmann::json;
using testing::HasSubstr;

/// The tools, run in a directory of their own, so that messages name files without their place.
class CliTest : public testing::Test {
 protected:
  /// "info", {"a.apgm"} runs apgm-info a.apgm; "" runs apgm.
  static std::vector<std::string> command(const std::string& verb, std::vector<std::string> arguments) {
    const std::string name = verb.empty() ? "apgm" : "apgm-" + verb;
    arguments.insert(arguments.begin(), std::string(APGM_BIN_DIR) + "/" + name);
    return arguments;
  }

  Outcome tool(const std::string& verb, const std::vector<std::string>& arguments, Launch launch = {}) const {
    launch.directory = directory_.path();
    return run(command(verb, arguments), launch);
  }

  std::string path(const std::string& name) const { return directory_ / name; }
  bool exists(const std::string& name) const { return std::filesystem::exists(path(name)); }

  std::string bytes(const std::string& name) const { return read_file(path(name)); }
  void put(const std::string& name, const std::string& content) const { write_file(path(name), content); }
  /// Names of all files.
  std::set<std::string> files() const {
    const std::vector<std::string> names = directory_.list();
    return {names.begin(), names.end()};
  }

  void write(const std::string& name, const Map& map, WriterOptions options = {}) const {
    options.output.overwrite = true;
    Writer writer(path(name), map.header(), options);
    copy(map, map.header().types, writer, true);
    writer.finish();
  }
  /// A map of rooms; the same for the same seed.
  void write_random(const std::string& name, std::uint64_t seed, const RandomMapOptions& options = {}) const {
    write(name, random_map(seed, options));
  }
  /// One occupancy layer a patch, all cells (0.25, 0.5), patches (0,0) to (nx-1, ny-1) of 12.8 m, step 3.
  Map plain_map(int nx, int ny, Frame frame = {}) const {
    MapHeader header;
    header.frame = frame;
    header.types = TypeTable({LayerType::occupancy()});
    Map map(header);
    for (int y = 0; y < ny; ++y) {
      for (int x = 0; x < nx; ++x) {
        Layer& layer = map.layer({x, y}, 0, 3);
        std::fill(layer.plane(0).begin(), layer.plane(0).end(), 0.25f);
        std::fill(layer.plane(1).begin(), layer.plane(1).end(), 0.5f);
      }
    }
    return map;
  }
  Map empty_map() const { return plain_map(0, 0); }

  Json info(const std::string& name, std::vector<std::string> options = {}) const {
    options.push_back("--json");
    options.push_back(name);
    const Outcome outcome = tool("info", options);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return Json::parse(outcome.out, nullptr, false);
  }

  TempDir directory_;
};

/// A failure: its code, its message, and where not empty its hint. Nothing on standard output.
inline void expect_failure(const Outcome& outcome, int code, const std::string& message,
                           const std::string& hint = "") {
  EXPECT_EQ(outcome.code, code) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr(": error: "));
  EXPECT_THAT(outcome.err, HasSubstr(message));
  EXPECT_THAT(outcome.err, HasSubstr(hint.empty() ? "" : "\nhint: "));
  EXPECT_THAT(outcome.err, HasSubstr(hint));
  EXPECT_EQ(outcome.out, "");
}

inline void expect_silent(const Outcome& outcome) {
  EXPECT_EQ(outcome.code, 0);
  EXPECT_EQ(outcome.out, "");
  EXPECT_EQ(outcome.err, "");
}

}  // namespace apgm::test
