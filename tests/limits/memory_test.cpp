#include <gmock/gmock.h>
#include <gtest/gtest.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <regex>

#include "big_map.hpp"
#include "temp_dir.hpp"

namespace apgm::test {
namespace {

using testing::AnyOf;
using testing::HasSubstr;

constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;

struct Measured {
  int code = -1;
  double peak_mib = 0;
  std::string err;
};

/// Makes a file in a process of its own, which takes its memory along when it ends.
template <typename Make>
void in_own_process(Make make) {
  const pid_t child = ::fork();
  if (child == 0) {
    try {
      make();
    } catch (const std::exception& error) {
      std::fprintf(stderr, "%s\n", error.what());
      ::_exit(1);
    }
    ::_exit(0);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_EQ(status, 0);
}

/// Runs a program and measures the most memory it ever had, which counts from what this process has:
/// ru_maxrss of a child starts there and stays when another program takes its place.
Measured measured(const std::vector<std::string>& line, const std::string& directory) {
  const std::string errors = directory + "/stderr";
  std::vector<char*> arguments;
  for (const std::string& word : line) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
#ifdef __GLIBC__
  ::malloc_trim(0);
#endif
  const pid_t child = ::fork();
  if (child == 0) {
    if (::chdir(directory.c_str()) != 0 || std::freopen(errors.c_str(), "w", stderr) == nullptr) ::_exit(127);
    ::execv(arguments[0], arguments.data());
    ::_exit(127);
  }
  int status = 0;
  struct rusage usage {};
  EXPECT_EQ(::wait4(child, &status, 0, &usage), child);
  return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status),
          static_cast<double>(usage.ru_maxrss) / 1024, read_file(errors)};
}

std::string tool(const std::string& verb) { return std::string(APGM_BIN_DIR) + "/apgm-" + verb; }

/// The least budget as a refusal tells it, in MiB; 0 if it does not.
int told(const Measured& run) {
  static const std::regex size("pass --max-memory (?:with at least )?([0-9]+) ?MiB");
  std::smatch match;
  return std::regex_search(run.err, match, size) ? std::stoi(match[1]) : 0;
}

struct HeavyCommand {
  std::string name;
  std::string verb;  ///< with the command behind it, where the tool has some
  std::vector<std::string> arguments;
  /// The least budget can be told before the work starts; else it only shows on the way.
  bool tells_least = true;
  double most_mib = 0;  ///< of the least budget: a tenth of the map, unless said otherwise
};
std::ostream& operator<<(std::ostream& out, const HeavyCommand& command) { return out << command.name; }

/// Maps that are ten times larger than what the tools are given. Made once.
class MemoryTest : public testing::TestWithParam<HeavyCommand> {
 protected:
  static constexpr std::uint64_t kMapBytes = 320 * kMiB;

  static void SetUpTestSuite() {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    return;
#endif
    directory_ = new TempDir;
    ASSERT_NO_FATAL_FAILURE(in_own_process(write_maps));
    write_log(*directory_ / "run.log");
    write_file(*directory_ / "profile.yaml",
               "requirements: [{layer: occupancy, horizon_m: 40, cell_m: 0.1}]\n");
    for (const std::string name : {"grid.tif", "grid.yaml", "grid.npz"}) {
      const Measured run = measured({tool("convert"), "-q", "a.apgm", "-o", name}, directory_->path());
      ASSERT_THAT(run.code, AnyOf(0, 3)) << run.err;
    }
    const Measured run = measured({tool("convert"), "-q", "--bbox", "0,0,50,50", "a.apgm", "-o", "grid.ot"},
                                  directory_->path());
    ASSERT_THAT(run.code, AnyOf(0, 3)) << run.err;
    for (const std::string map : {"a.apgm", "b.apgm", "many.apgm"}) {
      const std::string archive = map == "many.apgm" ? "many_history.apgm" : "history.apgm";
      const Measured commit = measured({tool("archive"), "commit", "-q", archive, map}, directory_->path());
      ASSERT_EQ(commit.code, 0) << commit.err;
    }
    write_torn(*directory_ / "many.apgm", *directory_ / "torn.apgm");
  }
  static void TearDownTestSuite() {
    delete directory_;
    directory_ = nullptr;
  }

  void SetUp() override {
    if (directory_ == nullptr) GTEST_SKIP() << "the sanitizer needs memory of its own";
  }

  static void write_maps() {
    BigMap map;
    map.value_bytes = kMapBytes;
    map.write(*directory_ / "a.apgm");
    map.pattern = 5;
    map.write(*directory_ / "b.apgm");
    map.datum_um = 1'000'000;  // 20 cells
    map.write(*directory_ / "shifted.apgm");
    map.datum_um = 10'001;  // between cells
    map.value_bytes = kMapBytes / 10;
    map.write(*directory_ / "between.apgm");
    map.datum_um = 0;
    map.value_bytes = kMapBytes;
    map.heights = true;
    map.write(*directory_ / "two.apgm");
    map.heights = false;
    map.step = 4;  // 2 KiB a layer: lists of layers are what takes memory
    map.write(*directory_ / "many.apgm");
  }

  /// Without the root of the index and the footer.
  static void write_torn(const std::string& from, const std::string& to) {
    std::filesystem::copy_file(from, to);
    std::filesystem::resize_file(to, std::filesystem::file_size(to) - 4096);
  }

  /// A laser that drives far: its map is large.
  static void write_log(const std::string& path) {
    std::ofstream text(path);
    for (int i = 0; i < 600; ++i) {
      text << "FLASER 61";
      for (int beam = 0; beam <= 60; ++beam) text << ' ' << 4 + (beam * 7 + i) % 40 / 10.0;
      text << ' ' << 2 * i << " 0 0 " << 2 * i << " 0 0 " << 100 + 0.1 * i << " host " << 0.1 * i << '\n';
    }
  }

  static Measured run(const std::string& budget, const std::vector<std::string>& more = {}) {
    const HeavyCommand& command = GetParam();
    // Not one that is there: a picture of other descriptions is not replaced.
    for (const std::string& name : directory_->list()) {
      if (name.starts_with("out.")) std::filesystem::remove(*directory_ / name);
    }
    const std::size_t space = command.verb.find(' ');
    std::vector<std::string> line{tool(command.verb.substr(0, space))};
    if (space != std::string::npos) line.push_back(command.verb.substr(space + 1));
    line.insert(line.end(), {"-q", "--max-memory", budget});
    line.insert(line.end(), command.arguments.begin(), command.arguments.end());
    line.insert(line.end(), more.begin(), more.end());
    return measured(line, directory_->path());
  }

  static inline TempDir* directory_ = nullptr;
};

// A budget that is too small is refused, with one that is enough; and what is allowed is never exceeded.
TEST_P(MemoryTest, StaysWithinTheLeastBudget) {
  const Measured refused = run("1M");
  EXPECT_EQ(refused.code, 6) << refused.err;
  EXPECT_THAT(refused.err, HasSubstr("--max-memory"));
  if (!GetParam().tells_least) return;
  int least = told(refused);
  ASSERT_GT(least, 1) << refused.err;
  // What the tool holds beside its work depends on how far it came: a second refusal may ask for more.
  Measured done = run(std::to_string(least) + "MiB");
  for (int again = 0; again < 3 && done.code == 6; ++again) {
    least = told(done);
    ASSERT_GT(least, 0) << done.err;
    done = run(std::to_string(least) + "MiB");
  }
  EXPECT_THAT(done.code, AnyOf(0, 1, 3)) << done.err;
  EXPECT_LE(done.peak_mib, least) << "of the least budget";
  const double most =
      GetParam().most_mib > 0 ? GetParam().most_mib : static_cast<double>(kMapBytes / kMiB) / 10;
  EXPECT_LE(least, most) << "to be had within a tenth of the map";
  RecordProperty("least_mib", least);
  std::printf("  %-22s least budget %3d MiB, peak %.1f MiB\n", GetParam().name.c_str(), least, done.peak_mib);
}

TEST_P(MemoryTest, StaysWithinMore) {
  constexpr int kMebibytes = 64;
  const Measured done = run(std::to_string(kMebibytes) + "MiB", {"-j", "2"});
  EXPECT_THAT(done.code, AnyOf(0, 1, 3, 6)) << done.err;
  EXPECT_LE(done.peak_mib, kMebibytes);
}

std::vector<HeavyCommand> heavy_commands() {
  const auto with = [](std::vector<std::string> arguments, const std::string& output) {
    arguments.insert(arguments.end(), {"-O", "-o", output});
    return arguments;
  };
  return {
      {"merge", "merge", with({"a.apgm", "b.apgm"}, "out.apgm")},
      {"merge_types", "merge", with({"two.apgm", "a.apgm"}, "out.apgm")},
      {"merge_shifted", "merge", with({"a.apgm", "shifted.apgm"}, "out.apgm")},
      {"merge_regrid", "merge", with({"between.apgm", "a.apgm", "--regrid"}, "out.apgm")},
      {"merge_hard_packed", "merge", with({"between.apgm", "--level", "19"}, "out.apgm"), true, 64},
      {"merge_conflicts", "merge", with({"a.apgm", "b.apgm", "--conflict-map", "out.png"}, "out.apgm"), true,
       160},
      {"merge_regrid_conflicts", "merge",
       with({"between.apgm", "a.apgm", "--regrid", "--conflict-map", "out.png"}, "out.apgm"), true, 160},
      {"crop", "crop", with({"a.apgm", "--bbox", "10,10,200,200", "--snap", "cell"}, "out.apgm")},
      {"resample", "resample", with({"a.apgm", "--step", "6"}, "out.apgm")},
      {"resample_finer", "resample", with({"between.apgm", "--step", "8"}, "out.apgm")},
      {"resample_regrid", "resample", with({"between.apgm", "--edge", "10"}, "out.apgm")},
      {"render", "render", with({"a.apgm", "--scale", "1.6"}, "out.png")},
      {"map", "map", with({"run.log", "--resolution", "0.05"}, "out.apgm"), true, 96},
      {"recode", "convert", with({"a.apgm", "--level", "1"}, "out.apgm"), true, 96},
      {"to_map_server", "convert", with({"a.apgm"}, "out.yaml"), true, 96},
      {"to_png", "convert", with({"a.apgm", "--set", "image=png"}, "out.yaml"), true, 96},
      {"to_geotiff", "convert", with({"a.apgm"}, "out.tif"), true, 96},
      {"to_numpy", "convert", with({"a.apgm"}, "out.npz"), true, 96},
      {"to_octomap", "convert", with({"a.apgm"}, "out.ot"), false},
      {"to_fixed_grid", "convert", with({"between.apgm", "--set", "layout=hash_map"}, "out.apfg"), true, 320},
      {"from_geotiff", "convert", with({"grid.tif"}, "out.apgm"), true, 96},
      {"from_map_server", "convert", with({"grid.yaml"}, "out.apgm"), true, 320},
      {"from_numpy", "convert", with({"grid.npz"}, "out.apgm"), true, 800},
      {"from_octomap", "convert", with({"grid.ot"}, "out.apgm"), true, 400},
      {"verify", "verify", {"many.apgm"}, true, 64},
      {"verify_deep", "verify", {"--deep", "a.apgm"}},
      {"recover", "verify", with({"--recover", "a.apgm"}, "out.apgm")},
      {"recover_many", "verify", with({"--recover", "torn.apgm"}, "out.apgm"), true, 96},
      {"diff", "diff", {"a.apgm", "b.apgm"}},
      {"diff_regions", "diff", {"a.apgm", "b.apgm", "--top", "5"}, true, 64},
      {"diff_picture", "diff", {"-O", "a.apgm", "b.apgm", "--png", "out.png"}, true, 160},
      {"diff_delta", "diff", {"-O", "a.apgm", "b.apgm", "--delta", "out.apgm"}},
      {"compare", "compare", {"between.apgm", "--reach", "20"}, true, 640},
      {"compare_costs", "compare", {"between.apgm", "--reach", "20", "--cost"}, true, 640},
      {"compare_drive", "compare", {"run.log", "--profile", "profile.yaml"}, true, 320},
      {"commit", "archive commit", {"out.apgm", "a.apgm"}},
      {"checkout", "archive checkout", with({"history.apgm", "--at", "1"}, "out.apgm")},
      {"compact", "archive compact", with({"history.apgm"}, "out.apgm")},
      {"compact_many", "archive compact", with({"many_history.apgm"}, "out.apgm"), true, 64},
  };
}

INSTANTIATE_TEST_SUITE_P(Tools, MemoryTest, testing::ValuesIn(heavy_commands()),
                         [](const auto& one) { return one.param.name; });

/// Scans that are mapped with budgets of all sizes.
struct ScanCase {
  std::string name;
  std::vector<std::string> arguments;
  std::string log;  ///< of the real ones; else the log is made
  int scans = 0;
  double circle_m = 0;  ///< the robot goes round and round
  double range_m = 0;
};
std::ostream& operator<<(std::ostream& out, const ScanCase& one) { return out << one.name; }

class ScanMemoryTest : public testing::TestWithParam<ScanCase> {
 protected:
  static constexpr int kMostMebibytes = 64;

  void SetUp() override {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "the sanitizer needs memory of its own";
#endif
    const ScanCase& one = GetParam();
    if (one.log.empty()) return write_log(log_ = dir_ / "run.log");
    const char* data = std::getenv("APGM_REAL_DATA");
    if (data == nullptr) GTEST_SKIP() << "APGM_REAL_DATA is not set";
    log_ = std::string(data) + "/" + one.log;
  }

  static void write_log(const std::string& path) {
    const ScanCase& one = GetParam();
    std::ofstream text(path);
    for (int i = 0; i < one.scans; ++i) {
      text << "FLASER 181";
      for (int beam = 0; beam <= 180; ++beam) text << ' ' << one.range_m + (beam * 7 + i) % 40 / 10.0;
      const double angle = 0.5 * i, x = one.circle_m * std::cos(angle), y = one.circle_m * std::sin(angle);
      text << ' ' << x << ' ' << y << ' ' << angle << ' ' << x << ' ' << y << ' ' << angle << ' '
           << 100 + 0.1 * i << " host " << 0.1 * i << '\n';
    }
  }

  /// @param mebibytes  0: no budget
  Measured map(int mebibytes) const {
    std::vector<std::string> line{tool("map"), "-q", log_};
    line.insert(line.end(), GetParam().arguments.begin(), GetParam().arguments.end());
    line.insert(line.end(), {"-O", "-o", "out.apgm"});
    if (mebibytes > 0) line.insert(line.end(), {"--max-memory", std::to_string(mebibytes) + "MiB"});
    return measured(line, dir_.path());
  }

  /// Not the bytes: memory of this process counts for the next.
  std::size_t hash_of_map() const { return std::hash<std::string>()(read_file(dir_ / "out.apgm")); }

  TempDir dir_;
  std::string log_;
};

// Layers rest and come back the more often the less memory there is: that must not take memory.
TEST_P(ScanMemoryTest, StaysWithinEveryBudget) {
  ASSERT_EQ(map(0).code, 0);
  const std::size_t expected = hash_of_map();
  int accepted = 0;
  for (int budget = 12; budget <= kMostMebibytes; budget += 4) {
    SCOPED_TRACE("budget " + std::to_string(budget) + " MiB");
    const Measured run = map(budget);
    std::printf("  %-14s %2d MiB: exit code %d, peak %.1f MiB\n", GetParam().name.c_str(), budget, run.code,
                run.peak_mib);
    ASSERT_THAT(run.code, AnyOf(0, 6)) << run.err;
    EXPECT_LE(run.peak_mib, budget);
    if (run.code == 6) {
      EXPECT_EQ(accepted, 0) << "less was enough; " << run.err;
      continue;
    }
    accepted = budget;
    EXPECT_EQ(hash_of_map(), expected) << "the map depends on the budget";
  }
}

TEST_P(ScanMemoryTest, StaysWithinTheBudgetThatIsTold) {
  int budget = 12;
  Measured run = map(budget);
  for (int again = 0; again < 4 && run.code == 6; ++again) {
    ASSERT_GT(told(run), budget) << run.err;
    budget = told(run);
    run = map(budget);
  }
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_LE(run.peak_mib, budget);
  std::printf("  %-14s told %d MiB, peak %.1f MiB\n", GetParam().name.c_str(), budget, run.peak_mib);
}

std::vector<ScanCase> scan_cases() {
  const std::vector<std::string> fine{"--resolution", "0.05"};
  return {
      {"returns", fine, "", 60, 25, 8},
      {"far", fine, "", 8, 5, 70},
      {"small_patches", {"--resolution", "0.1", "--edge", "0.4"}, "", 60, 40, 20},
      {"hard_packed", {"--resolution", "0.05", "--level", "19"}, "", 20, 25, 8},
      {"intel", fine, "scans/intel.gfs.log"},
      {"intel_fine", {"--resolution", "0.025", "--to-scan", "200"}, "scans/intel.gfs.log"},
      {"clinic", {"--resolution", "0.1", "--to-scan", "600"}, "scans/fr-clinic_robotlaser.clf.bz2"},
  };
}

INSTANTIATE_TEST_SUITE_P(Scans, ScanMemoryTest, testing::ValuesIn(scan_cases()),
                         [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace apgm::test
