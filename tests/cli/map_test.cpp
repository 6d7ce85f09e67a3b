#include <signal.h>
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <sstream>

#include "cli_test.hpp"

namespace apgm::test {
namespace {

class MapCliTest : public CliTest {
 protected:
  Outcome map(std::vector<std::string> arguments) const { return tool("map", arguments); }

  /// A vehicle that drives along x in a square room with walls at 8 m, and looks ahead.
  static std::string log(int scans, double step_m = 0.05, double step_s = 0.1) {
    std::ostringstream text;
    for (int i = 0; i < scans; ++i) {
      const double x = step_m * i;
      text << "FLASER 61";
      for (int beam = 0; beam <= 60; ++beam) {
        const double angle = (beam * 3 - 90) * 3.14159265358979 / 180;
        const double ahead = (8 - std::fmod(x, 4)) / std::max(1e-9, std::cos(angle));
        text << ' ' << std::min(ahead, 8 / std::max(1e-9, std::fabs(std::sin(angle))));
      }
      text << ' ' << x << " 0 0 " << x << " 0 0 " << 100 + step_s * i << " host " << step_s * i << '\n';
    }
    return text.str();
  }
  /// A real recording, or "".
  static std::string real_data(const std::string& name) {
    const char* dir = std::getenv("APGM_REAL_DATA");
    const std::string path =
        std::string(dir != nullptr ? dir : APGM_SOURCE_DIR "/../shared/data") + "/" + name;
    return std::filesystem::exists(path) ? std::filesystem::canonical(path).string() : "";
  }
  std::vector<std::string> lines(const std::string& name) const {
    std::vector<std::string> all;
    std::istringstream in(bytes(name));
    for (std::string line; std::getline(in, line);) all.push_back(line);
    return all;
  }
};

TEST_F(MapCliTest, MapsALog) {
  put("run.log", log(40));
  expect_silent(map({"run.log", "-o", "run.apgm"}));
  const Json document = info("run.apgm", {"--history", "--extended"});
  ASSERT_EQ(document["layers"].size(), 1u);
  EXPECT_EQ(document["layers"][0]["name"], "occupancy");
  EXPECT_GT(document["map"]["patches"], 1);
  EXPECT_EQ(document["map"]["frame_id"], "map");
  const Json step = document["history"][0];
  EXPECT_EQ(step["operation"], "map");
  EXPECT_EQ(step["inputs"], Json({"carmen"}));
  EXPECT_EQ(step["parameters"]["scans"], 40);
  EXPECT_EQ(step["parameters"]["resolution_m"], 0.1);
  EXPECT_EQ(files(), (std::set<std::string>{"run.log", "run.apgm"}));
}

TEST_F(MapCliTest, OptionsOfTheMapAreKept) {
  put("run.log", log(5));
  const Outcome outcome =
      map({"run.log", "--edge", "6.4", "--datum", "-3.2,1.5", "--frame-id", "yard", "--epsg", "25832",
           "--resolution", "0.2", "--model", "richter", "-o", "run.apgm"});
  expect_silent(outcome);
  const Json document = info("run.apgm", {"--history"});
  EXPECT_EQ(document["map"]["frame_id"], "yard");
  EXPECT_EQ(document["map"]["epsg"], 25832);
  EXPECT_EQ(document["map"]["edge_m"], 6.4);
  EXPECT_EQ(document["history"][0]["parameters"]["richter"]["p_fn"], 0.8);
  EXPECT_EQ(document["history"][0]["parameters"]["resolution_m"], 0.2);
}

TEST_F(MapCliTest, CellsAreAPartOfTheEdge) {
  put("run.log", log(5));
  const Outcome outcome = map({"run.log", "--resolution", "0.3", "-o", "run.apgm"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("note: cells are 0.2 m: the edge 12.8 m divided by a power of two"));
}

TEST_F(MapCliTest, SameBytesWhateverTheMemory) {
  put("run.log", log(600, 0.3));
  ASSERT_EQ(map({"run.log", "-o", "a.apgm"}).code, 0);
  ASSERT_EQ(map({"run.log", "-j", "1", "--max-memory", "24M", "-o", "b.apgm"}).code, 0);
  ASSERT_EQ(map({"run.log", "-o", "c.apgm"}).code, 0);
  EXPECT_EQ(bytes("a.apgm"), bytes("c.apgm"));
  EXPECT_EQ(bytes("a.apgm"), bytes("b.apgm"));
}

TEST_F(MapCliTest, StandardInputAndOutput) {
  put("run.log", log(5));
  ASSERT_EQ(map({"run.log", "-o", "a.apgm"}).code, 0);
  Launch launch;
  launch.input = path("run.log");
  const Outcome outcome = tool("map", {"-", "-o", "-"}, launch);
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.out, bytes("a.apgm"));
  expect_failure(map({"-", "-", "-o", "b.apgm"}), 2, "standard input '-' is named twice");
}

TEST_F(MapCliTest, HalvesOfALogAreItsScans) {
  put("run.log", log(20));
  const auto scans = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"--json", "-O", "run.log", "-o", "a.apgm"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Json::parse(map(arguments).out)["scans"];
  };
  EXPECT_EQ(scans({}), 20);
  EXPECT_EQ(scans({"--to-scan", "8"}), 8);
  EXPECT_EQ(scans({"--from-scan", "8"}), 12);
  EXPECT_EQ(scans({"--from-scan", "3", "--to-scan", "5"}), 2);
  expect_failure(map({"run.log", "--from-scan", "20", "-o", "b.apgm"}), 2,
                 "--from-scan 20 leaves no scan: there are 20");
  expect_failure(map({"run.log", "--from-scan", "5", "--to-scan", "5", "-o", "b.apgm"}), 2, "leave no scan");
  EXPECT_FALSE(exists("b.apgm"));
}

TEST_F(MapCliTest, FaultsAreCountedAndTold) {
  const std::string good = log(5);
  put("run.log", good + "FLASER 3 1 2\nBOGUS\n" + log(2));
  const Outcome outcome = map({"run.log", "-o", "run.apgm"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("warning: left out: 1 line was cut short (first: run.log:6)\n"));
  EXPECT_THAT(outcome.err, HasSubstr("warning: left out: 1 line is of no known kind (first: run.log:7)\n"));
  EXPECT_THAT(outcome.err,
              HasSubstr("warning: left out: 2 scans have times before the last one (first: run.log:8)\n"));
  const Json document = Json::parse(map({"--json", "-O", "run.log", "-o", "run.apgm"}).out);
  EXPECT_EQ(document["faults"][0]["name"], "cut_lines");
  EXPECT_EQ(document["faults"][0]["first"], "run.log:6");
  EXPECT_EQ(document["scans"], 5);
}

TEST_F(MapCliTest, ReportsWhatBecameOfTheReadings) {
  put("run.log", "FLASER 6 nan 0.01 81.83 5 5 -inf 0 0 0 0 0 0 1 host 1\n");
  const Json document = Json::parse(map({"--json", "run.log", "-o", "run.apgm"}).out);
  EXPECT_EQ(document["readings_skipped"]["not_a_number"], 1);
  EXPECT_EQ(document["readings_skipped"]["too_near"], 2);
  EXPECT_EQ(document["readings_skipped"]["no_return"], 1);
  EXPECT_EQ(document["beams"], 2);
  const Outcome outcome = map({"-O", "-v", "run.log", "-o", "run.apgm"});
  EXPECT_THAT(outcome.err, HasSubstr("1 scan with 2 beams; readings left out: 1 without return, 2 too near"));
  EXPECT_THAT(outcome.err, HasSubstr("x real time"));
}

TEST_F(MapCliTest, ReadingsWithoutAnyReturnGiveAMapWithoutPatches) {
  put("run.log", "FLASER 2 81.83 81.83 0 0 0 0 0 0 1 host 1\n");
  const Outcome outcome = map({"run.log", "-o", "run.apgm"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("the result holds no patches"));
  EXPECT_EQ(info("run.apgm")["map"]["patches"], 0);
}

TEST_F(MapCliTest, NothingUsableIsAnErrorAndLeavesNothing) {
  put("run.log", "FLASER 3 1 2\n");
  expect_failure(
      map({"run.log", "--stats", "s.csv", "-o", "run.apgm"}), 4,
      "'run.log' holds no scan with a pose that can be used: 1 line was cut short (first: run.log:1)");
  expect_failure(map({"gone.log", "-o", "run.apgm"}), 4, "cannot open 'gone.log'", "check the name");
  put("noise", "\x01\x02");
  expect_failure(map({"noise", "-o", "run.apgm"}), 4, "'noise' is of no known format of scans", "--from");
  EXPECT_EQ(files(), (std::set<std::string>{"run.log", "noise"}));
}

TEST_F(MapCliTest, OutputRules) {
  put("run.log", log(3));
  put("run.apgm", "old");
  expect_failure(map({"run.log", "-o", "run.apgm"}), 5, "output 'run.apgm' already exists", "--overwrite");
  EXPECT_EQ(bytes("run.apgm"), "old");
  expect_failure(map({"run.log", "-O", "-o", "run.log"}), 2, "is the input 'run.log'");
  expect_failure(map({"run.log", "-O", "--stats", "run.log", "-o", "b.apgm"}), 2, "is the input 'run.log'");
  expect_failure(map({"run.log", "--stats", "b.apgm", "-o", "b.apgm"}), 2, "are the same file");
  expect_failure(map({"run.log", "--stats", "-", "-o", "b.apgm"}), 2,
                 "--stats is not written to standard output");
  expect_failure(map({"run.log"}), 2, "no output is given");
  expect_silent(map({"run.log", "-n", "-o", "b.apgm"}));
  EXPECT_FALSE(exists("b.apgm"));
}

TEST_F(MapCliTest, AFileSizeLimitIsAFullDisk) {
  put("run.log", log(400));
  const std::string tool = command("map", {})[0];
  const Outcome outcome =
      run({"/bin/sh", "-c", "ulimit -f 4; cd '" + path("") + "' && '" + tool + "' run.log -o run.apgm"});
  EXPECT_EQ(outcome.code, 5) << outcome.err;
  EXPECT_EQ(files(), (std::set<std::string>{"run.log"}));
}

TEST_F(MapCliTest, NothingThatIsReadIsAnOutput) {
  put("one.csv", "x,y,z\n1,0,0\n2,1,0\n");
  put("list.csv",
      "reading, gT00, gT01, gT02, gT03, gT10, gT11, gT12, gT13, gT20, gT21, gT22, gT23, gT30, gT31, gT32, "
      "gT33\n"
      "one.csv, 1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1\n");
  const std::string cloud = bytes("one.csv");
  for (const auto& outputs :
       {std::vector<std::string>{"-o", "one.csv"}, {"-o", "a.apgm", "--stats", "one.csv"}}) {
    std::vector<std::string> arguments{"list.csv", "--from", "cloud_list", "-O"};
    arguments.insert(arguments.end(), outputs.begin(), outputs.end());
    expect_failure(map(arguments), 2, "'one.csv' is the input");
    EXPECT_EQ(bytes("one.csv"), cloud);
  }
  put("run.log", log(3));
  for (const std::string& stats : std::vector<std::string>{
           "a.apgm", "./a.apgm",
           "../" + std::filesystem::path(path("")).parent_path().filename().string() + "/a.apgm"}) {
    expect_failure(map({"run.log", "-o", "a.apgm", "--stats", stats}), 2, "are the same file");
    EXPECT_FALSE(exists("a.apgm"));
  }
}

TEST_F(MapCliTest, ArgumentsAreCheckedBeforeAScanIsRead) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases{
      {{"--resolution", "0"}, "--resolution takes a number above 0"},
      {{"--resolution", "fine"}, "--resolution takes"},
      {{"--edge", "0"}, "--edge takes a number from"},
      {{"--datum", "1"}, "--datum takes 2 numbers X,Y"},
      {{"--datum", "0.00000012,0"}, "whole micrometres"},
      {{"--epsg", "0"}, "--epsg takes a whole number"},
      {{"--ageing", "1.5"}, "--ageing takes a number above 0 and up to 1"},
      {{"--ageing", "0"}, "--ageing takes"},
      {{"--min-unknown", "0.6"}, "--min-unknown takes a number from 0 to 0.5"},
      {{"--model", "nus"}, "--model takes one of nuss, richter"},
      {{"--heights", "2,1"}, "--heights takes ZMIN,ZMAX with ZMIN < ZMAX"},
      {{"--from", "carman"}, "--from takes one of"},
      {{"--to-scan", "0"}, "--to-scan takes"},
      {{"--max-memory", "much"}, "--max-memory takes"}};
  for (const auto& [more, message] : cases) {
    std::vector<std::string> arguments{"gone.log", "-o", "run.apgm"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    expect_failure(map(arguments), 2, message);
  }
  expect_failure(map({"gone.log", "--resolution", "0.001", "-o", "run.apgm"}), 6, "");
  EXPECT_TRUE(files().empty());
}

TEST_F(MapCliTest, OutputsThatAreNoFilesOfADirectory) {
  put("run.log", log(5));
  expect_silent(map({"run.log", "-o", "a.apgm"}));
  expect_silent(map({"run.log", "-o", "/dev/null"}));
  std::filesystem::create_directory(directory_ / "far");
  put("far/b.apgm", "old");
  std::filesystem::create_symlink("far/b.apgm", directory_ / "link.apgm");
  expect_silent(map({"run.log", "-O", "-o", "link.apgm"}));
  EXPECT_EQ(bytes("link.apgm"), bytes("a.apgm"));
  const std::string pipe = path("pipe");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  Launch launch;
  launch.directory = directory_.path();
  Process reader({"/bin/cat", pipe}, launch);
  expect_silent(map({"run.log", "-o", "pipe"}));
  EXPECT_EQ(reader.wait().out, bytes("a.apgm"));
}

TEST_F(MapCliTest, BudgetsThatCannotDoAreToldBeforeAScanIsRead) {
  const std::vector<std::string> fine{"gone.log", "--resolution", "0.00625", "-o", "a.apgm", "--max-memory"};
  const auto with = [](std::vector<std::string> arguments, const std::string& more) {
    arguments.push_back(more);
    return arguments;
  };
  // 32 MiB a layer, and 16 of them at work.
  expect_failure(map(with(fine, "64M")), 6, "--max-memory does not hold what it takes to write one layer",
                 "pass --max-memory with at least 5");
  expect_failure(map(with(fine, "600M")), 4, "cannot open 'gone.log'");
  put("p.yaml", "requirements: [{layer: occupancy, horizon_m: 100, cell_m: 0.1}]");
  const std::vector<std::string> profile{"gone.log", "--profile", "p.yaml", "-o", "a.apgm", "--max-memory"};
  expect_failure(map(with(profile, "64M")), 6, "does not hold the layers that the profile asks for",
                 "pass --max-memory with at least 1");
  expect_failure(map(with(profile, "160M")), 4, "cannot open 'gone.log'");
}

TEST_F(MapCliTest, MemoryDoesNotGrowWithTheMap) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "the sanitizer needs memory of its own";
#endif
  const auto peak_mib = [&](int scans) {
    put("run.log", log(scans, 2));
    const Outcome outcome =
        map({"-O", "-v", "-j2", "--resolution", "0.05", "--max-memory", "24M", "run.log", "-o", "a.apgm"});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    const std::string label = "peak memory ";
    return std::stod(outcome.err.substr(outcome.err.find(label) + label.size()));
  };
  const double small = peak_mib(100);
  EXPECT_GT(small, 1);
  const double large = peak_mib(1600);
  const double map_mib = info("a.apgm")["map"]["patches"].get<double>() / 2;
  EXPECT_GT(map_mib, 10 * 24);
  EXPECT_LE(large, 24);
  EXPECT_LT(large, small + 4);
  EXPECT_LT(large, map_mib / 2);
}

class MapYamlTest : public MapCliTest {
 protected:
  /// The failure of a YAML file, although the log does not even exist.
  void expect_refused(const std::string& option, const std::string& yaml, const std::string& message) const {
    put("a.yaml", yaml);
    const Outcome outcome = map({"gone.log", option, "a.yaml", "-o", "run.apgm"});
    expect_failure(outcome, 2, message);
    EXPECT_THAT(outcome.err, HasSubstr("a.yaml"));
    EXPECT_EQ(files(), (std::set<std::string>{"a.yaml"}));
  }
};

TEST_F(MapYamlTest, ProfilesAreCheckedBeforeAnyWork) {
  expect_refused("--profile", "requirements: [{layer: ocupancy, horizon_m: 20, cell_m: 0.1}]", "ocupancy");
  expect_refused("--profile", "requirements: [{layer: occupancy, horizon_m: 20, cell_m: 0.3}]", "'a.yaml': ");
  expect_refused(
      "--profile",
      "requirements: [{layer: occupancy, bands: [{from_m: 0, to_m: 20, cell_m: 0.1}, {from_m: 10, to_m: "
      "30, cell_m: 0.2}]}]",
      "overlap");
  expect_refused("--profile", "requirements: [", "");
  expect_refused("--models", "nuss: {occ_max: 2}", "occ_max");
  expect_refused("--models", "nus: {}", "nus");
  expect_failure(map({"gone.log", "--profile", "gone.yaml", "-o", "run.apgm"}), 4, "gone.yaml");
  put("p.yaml", "requirements: [{layer: occupancy, horizon_m: 20, cell_m: 0.1}]");
  expect_failure(map({"gone.log", "--profile", "p.yaml", "--resolution", "0.1", "-o", "run.apgm"}), 2,
                 "--profile and --resolution exclude each other");
}

TEST_F(MapYamlTest, ProfilesChangeWithTime) {
  put("run.log", log(40));
  put("p.yaml",
      "profiles:\n"
      "  - {name: slow, requirements: [{layer: occupancy, horizon_m: 20, cell_m: 0.1}]}\n"
      "  - {name: fast, from_s: 2, requirements: [{layer: occupancy, horizon_m: 20, cell_m: 0.2}]}\n");
  expect_silent(map({"run.log", "--profile", "p.yaml", "--stats", "s.csv", "-o", "run.apgm"}));
  const std::vector<std::string> rows = lines("s.csv");
  ASSERT_EQ(rows.size(), 41u);
  EXPECT_EQ(rows[0], "scan,time_s,layer,patches,layers,cells,bytes,cells_fused,observe_ms,fuse_ms");
  const auto cells_a_layer = [&](std::size_t row) {
    std::vector<std::string> words;
    std::istringstream in(rows[row]);
    for (std::string word; std::getline(in, word, ',');) words.push_back(word);
    EXPECT_EQ(words.size(), 10u);
    EXPECT_EQ(words[0], std::to_string(row - 1));
    EXPECT_EQ(words[2], "occupancy");
    EXPECT_EQ(std::stoll(words[6]), 8 * std::stoll(words[5]));
    return std::stoll(words[5]) / std::stoll(words[4]);
  };
  EXPECT_EQ(cells_a_layer(1), 128 * 128);
  EXPECT_EQ(cells_a_layer(20), 128 * 128);
  EXPECT_EQ(cells_a_layer(21), 64 * 64);
  EXPECT_EQ(cells_a_layer(40), 64 * 64);
  const Json step = info("run.apgm", {"--history"})["history"][0]["parameters"];
  EXPECT_EQ(step["profiles"][1]["name"], "fast");
  EXPECT_EQ(step["profiles"][1]["requirements"][0]["ring_m"], Json({0, 20}));
}

TEST_F(MapYamlTest, TimeBeginsWithTheFirstScanThatIsMapped) {
  put("run.log", log(40));
  put("p.yaml",
      "profiles:\n"
      "  - {name: slow, requirements: [{layer: occupancy, horizon_m: 20, cell_m: 0.1}]}\n"
      "  - {name: fast, from_s: 2, requirements: [{layer: occupancy, horizon_m: 20, cell_m: 0.2}]}\n");
  expect_silent(
      map({"run.log", "--from-scan", "15", "--profile", "p.yaml", "--stats", "s.csv", "-o", "a.apgm"}));
  const std::vector<std::string> rows = lines("s.csv");
  ASSERT_EQ(rows.size(), 26u);
  EXPECT_EQ(rows[1].substr(0, 9), "15,0.000,");
  EXPECT_EQ(rows[21].substr(0, 9), "35,2.000,");
}

TEST_F(MapYamlTest, PatchesThatLeaveAProfileReachTheFile) {
  put("run.log", log(200, 1));
  put("p.yaml", "requirements: [{layer: occupancy, horizon_m: 20, cell_m: 0.1}]");
  expect_silent(map({"run.log", "--profile", "p.yaml", "-o", "a.apgm"}));
  ASSERT_EQ(map({"run.log", "-o", "b.apgm"}).code, 0);
  EXPECT_GE(info("a.apgm")["map"]["patches"], info("b.apgm")["map"]["patches"].get<int>() - 4);
}

TEST_F(MapYamlTest, ModelsAreReadFromAFile) {
  put("run.log", log(5));
  put("m.yaml", "model: richter\nlimits: {max_range_m: 12}\noccupancy_layer: walls\n");
  expect_silent(map({"run.log", "--models", "m.yaml", "-o", "run.apgm"}));
  const Json document = info("run.apgm", {"--history"});
  EXPECT_EQ(document["layers"][0]["name"], "walls");
  EXPECT_EQ(document["history"][0]["parameters"]["max_range_m"], 12);
}

TEST_F(MapCliTest, CloudsNeedPosesAndAskForHeights) {
  put("a.xyz", "1 0 0\n2 0 0.5\n");
  put("b.xyz", "1 0 0\n2 0 0.5\n");
  expect_failure(map({"a.xyz", "b.xyz", "-o", "run.apgm"}), 2, "2 clouds have no poses", "--poses");
  put("poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 5 0 1 0 0 0 0 1 0\n");
  const Outcome outcome = map({"a.xyz", "b.xyz", "--poses", "poses.txt", "-o", "run.apgm"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("returns from all heights count as obstacles"));
  expect_silent(map({"a.xyz", "b.xyz", "--poses", "poses.txt", "--heights", "-1,1", "-o", "low.apgm"}));
  put("three.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 5 0 1 0 0 0 0 1 0\n1 0 0 9 0 1 0 0 0 0 1 0\n");
  expect_failure(map({"a.xyz", "b.xyz", "--poses", "three.txt", "-o", "x.apgm"}), 7, "3 poses for 2 clouds");
}

class MapSignalTest : public MapCliTest, public testing::WithParamInterface<int> {};

TEST_P(MapSignalTest, LeavesNothing) {
  put("run.log", log(60'000, 0.01));
  const std::set<std::string> before = files();
  Launch launch;
  launch.directory = directory_.path();
  Process process(command("map", {"run.log", "--progress", "--resolution", "0.025", "--stats", "s.csv", "-o",
                                  "run.apgm"}),
                  launch);
  ASSERT_TRUE(process.wait_for_error_text("mapping", std::chrono::seconds(60)));
  process.signal(GetParam());
  const Outcome outcome = process.wait();
  EXPECT_EQ(outcome.code, 130);
  EXPECT_THAT(outcome.err, HasSubstr("interrupted"));
  EXPECT_EQ(files(), before);
}

INSTANTIATE_TEST_SUITE_P(Signals, MapSignalTest, testing::Values(SIGINT, SIGTERM));

TEST_F(MapCliTest, RealLogWithSmallMemory) {
  const std::string recording = real_data("scans/intel.gfs.log");
  if (recording.empty()) GTEST_SKIP() << "no recording scans/intel.gfs.log";
  const Outcome whole = map({"--json", recording, "-o", "a.apgm"});
  ASSERT_EQ(whole.code, 0) << whole.err;
  const Json document = Json::parse(whole.out);
  EXPECT_EQ(document["scans"], 906);
  EXPECT_GT(document["times_real_time"], 50);
  ASSERT_EQ(map({"-q", "--max-memory", "24M", recording, "-o", "b.apgm"}).code, 0);
  EXPECT_EQ(bytes("a.apgm"), bytes("b.apgm"));
}

}  // namespace
}  // namespace apgm::test
