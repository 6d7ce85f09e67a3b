#include <signal.h>

#include "cli_test.hpp"

namespace apgm::test {
namespace {

class MergeCliTest : public CliTest {
 protected:
  Outcome merge(std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(), {"-o", "out.apgm"});
    return tool("merge", arguments);
  }
  std::string id(const std::string& name) const { return info(name)["map"]["content_id"]; }
};

TEST_F(MergeCliTest, OrderAndThreadsDoNotMatter) {
  write_random("a.apgm", 1);
  write_random("b.apgm", 2);
  ASSERT_EQ(tool("merge", {"a.apgm", "b.apgm", "-j1", "-o", "ab1.apgm"}).code, 0);
  ASSERT_EQ(tool("merge", {"b.apgm", "a.apgm", "-j2", "-o", "ba2.apgm"}).code, 0);
  EXPECT_EQ(bytes("ab1.apgm"), bytes("ba2.apgm"));
}

TEST_F(MergeCliTest, WithAnEmptyMapIsTheMap) {
  write("a.apgm", plain_map(3, 3));
  write("empty.apgm", empty_map());
  ASSERT_EQ(merge({"a.apgm", "empty.apgm"}).code, 0);
  EXPECT_EQ(id("out.apgm"), id("a.apgm"));
}

TEST_F(MergeCliTest, ReportsTotalConflicts) {
  Map free = plain_map(1, 1), taken = plain_map(1, 1);
  for (Map* map : {&free, &taken}) {
    Layer& layer = map->layer({0, 0}, 0, 3);
    layer.at(0, {2, 2}) = map == &taken ? 1.0f : 0.0f;
    layer.at(1, {2, 2}) = map == &taken ? 0.0f : 1.0f;
  }
  write("a.apgm", free);
  write("b.apgm", taken);
  const Outcome outcome = merge({"--json", "a.apgm", "b.apgm"});
  EXPECT_EQ(outcome.code, 0);
  const Json document = Json::parse(outcome.out);
  EXPECT_EQ(document["total_conflicts"], 1);
  const std::string warning = "1 cell was in total conflict (K = 1) and became unknown";
  EXPECT_EQ(document["warnings"], Json({warning}));
  EXPECT_THAT(outcome.err, HasSubstr("apgm-merge: warning: " + warning));
  EXPECT_EQ(document["rule"], "dempster");
  EXPECT_EQ(document["inputs"][1]["path"], "b.apgm");
  EXPECT_EQ(document["inputs"][1]["patches"], 1);
}

TEST_F(MergeCliTest, FramesThatDifferNeedAnAssumption) {
  Frame odom;
  odom.frame_id = "odom";
  write("a.apgm", plain_map(1, 1));
  write("b.apgm", plain_map(1, 1, odom));
  expect_failure(merge({"a.apgm", "b.apgm"}), 7,
                 "cannot merge 'a.apgm' and 'b.apgm': frames differ ('map' and 'odom')",
                 "pass --assume-frame map");
  EXPECT_FALSE(exists("out.apgm"));
  expect_silent(merge({"a.apgm", "b.apgm", "--assume-frame", "map"}));
}

TEST_F(MergeCliTest, EdgesAndDatumsThatDifferNeedRegrid) {
  Frame shifted, coarse;
  shifted.datum_x_um = 12'345;
  coarse.edge_um = 6'400'000;
  write("a.apgm", plain_map(2, 2));
  write("b.apgm", plain_map(2, 2, shifted));
  write("c.apgm", plain_map(2, 2, coarse));
  expect_failure(merge({"a.apgm", "b.apgm"}), 7, "datums differ", "--regrid");
  expect_failure(merge({"a.apgm", "c.apgm"}), 7, "edges differ", "--regrid");
  EXPECT_EQ(merge({"a.apgm", "b.apgm", "--regrid"}).code, 0);
  const Outcome outcome = merge({"-O", "-v", "--json", "a.apgm", "c.apgm", "--regrid"});
  EXPECT_THAT(outcome.err, HasSubstr("the result has patches of 6.4 m and the datum (0, 0) m"));
  EXPECT_EQ(Json::parse(outcome.out)["edge_m"], 6.4);
  EXPECT_EQ(Json::parse(outcome.out)["datum_m"], Json({0, 0}));
}

TEST_F(MergeCliTest, DryRunFindsInputsThatDoNotFit) {
  Frame odom;
  odom.frame_id = "odom";
  write("a.apgm", plain_map(1, 1));
  write("b.apgm", plain_map(1, 1, odom));
  expect_failure(merge({"-n", "a.apgm", "b.apgm"}), 7, "frames differ");
}

TEST_F(MergeCliTest, AllInputsAreOpenedBeforeAnythingIsWritten) {
  write("a.apgm", plain_map(1, 1));
  put("b.apgm", "nothing");
  expect_failure(merge({"a.apgm", "b.apgm"}), 4, "'b.apgm' is not an apgm file");
  EXPECT_FALSE(exists("out.apgm"));
}

TEST_F(MergeCliTest, BadRule) {
  write("a.apgm", plain_map(1, 1));
  expect_failure(merge({"--rule", "demster", "a.apgm"}), 2,
                 "--rule takes one of dempster, yager, mean, max, last; not 'demster'",
                 "did you mean 'dempster'?");
}

TEST_F(MergeCliTest, EveryRuleWorks) {
  write_random("a.apgm", 1);
  write_random("b.apgm", 2);
  for (const char* rule : {"dempster", "yager", "mean", "max", "last"}) {
    EXPECT_EQ(merge({"-O", "--rule", rule, "a.apgm", "b.apgm"}).code, 0) << rule;
  }
}

TEST_F(MergeCliTest, Discounts) {
  write("a.apgm", plain_map(1, 1));
  write("b.apgm", plain_map(1, 1));
  expect_failure(merge({"a.apgm", "--discount", "a.apgm"}), 2, "--discount takes NAME=VALUE, not 'a.apgm'");
  expect_failure(merge({"a.apgm", "--discount", "c.apgm=0.5"}), 2, "--discount: 'c.apgm' is not an input",
                 "a.apgm");
  expect_failure(merge({"a.apgm", "--discount", "a.apgm=1.5"}), 2, "takes a number from 0 to 1, not '1.5'");
  expect_failure(merge({"a.apgm", "--discount", "a.apgm=0.5", "--discount", "a.apgm=0.6"}), 2, "twice");
  ASSERT_EQ(merge({"a.apgm", "b.apgm", "--discount", "b.apgm=0"}).code, 0);
  EXPECT_EQ(id("out.apgm"), id("a.apgm"));
}

TEST_F(MergeCliTest, Resolution) {
  write("a.apgm", plain_map(1, 1));
  expect_failure(merge({"a.apgm", "--resolution", "0"}), 2, "--resolution takes a number above 0, not '0'");
  expect_failure(merge({"a.apgm", "--resolution", "nan"}), 2,
                 "--resolution takes a number above 0, not 'nan'");
  expect_failure(merge({"a.apgm", "--resolution", "1e-9"}), 6, "finer");
  ASSERT_EQ(merge({"a.apgm", "--resolution", "3.2"}).code, 0);
  EXPECT_EQ(info("out.apgm")["layers"][0]["steps"], Json({{"2", 1}}));
}

TEST_F(MergeCliTest, TheSameInputTwiceIsWorthAWarning) {
  write("a.apgm", plain_map(1, 1));
  const Outcome outcome = merge({"a.apgm", "a.apgm"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("apgm-merge: warning: 'a.apgm' is given twice and counts twice"));
}

TEST_F(MergeCliTest, TheSameFileByAnotherNameIsNoticed) {
  write("a.apgm", plain_map(1, 1));
  std::filesystem::create_hard_link(path("a.apgm"), path("b.apgm"));
  const Outcome outcome = merge({"a.apgm", "b.apgm"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("warning: 'a.apgm' and 'b.apgm' are the same file, which counts twice"));
}

TEST_F(MergeCliTest, DiscountTakesAnyNameOfAnInput) {
  write("a.apgm", plain_map(1, 1));
  write("b.apgm", plain_map(1, 1));
  expect_silent(merge({"a.apgm", "b.apgm", "--discount", "./b.apgm=0"}));
  EXPECT_EQ(id("out.apgm"), id("a.apgm"));
  expect_failure(merge({"-O", "a.apgm", "--discount", "a.apgm=0.5", "--discount", "./a.apgm=0.6"}), 2,
                 "twice");
}

TEST_F(MergeCliTest, StandardInputTwice) {
  expect_failure(merge({"-", "-"}), 2, "standard input '-' is named twice");
}

TEST_F(MergeCliTest, ForgottenOutputOverwritesNothing) {
  write("a.apgm", plain_map(1, 1));
  write("b.apgm", plain_map(2, 2));
  const std::string before = bytes("b.apgm");
  expect_failure(tool("merge", {"-O", "a.apgm", "b.apgm"}), 2, "no output is given", "-o b.apgm");
  EXPECT_EQ(bytes("b.apgm"), before);
}

TEST_F(MergeCliTest, ConflictMapIsAPicture) {
  write("a.apgm", plain_map(2, 1));
  write("b.apgm", plain_map(1, 1));
  expect_silent(merge({"a.apgm", "b.apgm", "--conflict-map", "k.png"}));
  EXPECT_EQ(bytes("k.png").substr(1, 3), "PNG");
  EXPECT_TRUE(exists("out.apgm"));
}

TEST_F(MergeCliTest, ConflictMapIsCheckedBeforeAnythingIsRead) {
  write("a.apgm", plain_map(2, 1));
  put("k.png", "precious");
  expect_failure(merge({"a.apgm", "--conflict-map", "k.png"}), 5, "output 'k.png' already exists");
  expect_failure(merge({"a.apgm", "--conflict-map", "./out.apgm"}), 2, "are the same file");
  expect_failure(merge({"-O", "a.apgm", "--conflict-map", "a.apgm"}), 2, "is the input");
  EXPECT_EQ(files(), (std::set<std::string>{"a.apgm", "k.png"}));
}

TEST_F(MergeCliTest, ConflictMapOnAFullDiskLeavesTheOldOutput) {
  write("a.apgm", plain_map(2, 1));
  write("b.apgm", plain_map(1, 1));
  put("out.apgm", "old");
  expect_failure(merge({"-O", "a.apgm", "b.apgm", "--conflict-map", "/dev/full"}), 5,
                 "No space left on device");
  EXPECT_EQ(bytes("out.apgm"), "old");
  EXPECT_EQ(files(), (std::set<std::string>{"a.apgm", "b.apgm", "out.apgm"}));
}

TEST_F(MergeCliTest, AnExtensionOfAnotherFormatIsWorthAWarning) {
  write("a.apgm", plain_map(1, 1));
  const Outcome outcome = tool("merge", {"a.apgm", "a.apgm", "-o", "x.PNG", "--conflict-map", "k.jpg"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("warning: 'x.PNG' gets .apgm content whatever its extension says"));
  EXPECT_THAT(outcome.err, HasSubstr("warning: 'k.jpg' gets .png content whatever its extension says"));
}

TEST_F(MergeCliTest, MemoryThatHoldsNoPatch) {
  write("a.apgm", plain_map(2, 2));
  write("b.apgm", plain_map(2, 2));
  expect_failure(merge({"a.apgm", "b.apgm", "--max-memory", "64B"}), 6, "", "--max-memory");
  EXPECT_FALSE(exists("out.apgm"));
}

TEST_F(MergeCliTest, DamagedLayerLeavesTheOldOutput) {
  write("a.apgm", plain_map(2, 2));
  put("out.apgm", "old");
  const std::string content = bytes("a.apgm");
  bool found = false;
  for (std::size_t at = 64; at < content.size() && !found; at += 16) {
    std::string damaged = content;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    put("b.apgm", damaged);
    if (tool("info", {"b.apgm"}).code != 0 || tool("info", {"--extended", "b.apgm"}).code != 4) continue;
    found = true;
    expect_failure(merge({"-O", "a.apgm", "b.apgm"}), 4, "'b.apgm' is damaged: patch (");
    EXPECT_EQ(bytes("out.apgm"), "old");
    EXPECT_EQ(files(), (std::set<std::string>{"a.apgm", "b.apgm", "out.apgm"}));
  }
  EXPECT_TRUE(found);
}

/// A merge that takes a while: noise, packed as hard as it goes.
class LongMergeTest : public MergeCliTest {
 protected:
  void SetUp() override {
    for (const char* name : {"a.apgm", "b.apgm"}) {
      MapHeader header;
      header.types = TypeTable({LayerType::occupancy()});
      Map map(header);
      Random random(static_cast<std::uint64_t>(name[0]));
      for (int x = 0; x < 100; ++x) {
        Layer& layer = map.layer({x, 0}, 0, 7);
        for (float& mass : layer.plane(0)) mass = static_cast<float>(random.unit() * 0.4);
        for (float& mass : layer.plane(1)) mass = static_cast<float>(random.unit() * 0.4);
      }
      WriterOptions fast;
      fast.level = 1;
      write(name, map, fast);
    }
    put("out.apgm", "old");
  }

  void expect_ended_by(int number) {
    Launch launch;
    launch.directory = directory_.path();
    Process process(
        command("merge", {"a.apgm", "b.apgm", "-j1", "--level", "19", "--progress", "-O", "-o", "out.apgm"}),
        launch);
    ASSERT_TRUE(process.wait_for_error_text("merging", std::chrono::seconds(60)));
    process.signal(number);
    const Outcome outcome = process.wait();
    EXPECT_EQ(outcome.code, 130) << outcome.err;
    EXPECT_EQ(bytes("out.apgm"), "old");
    EXPECT_EQ(files(), (std::set<std::string>{"a.apgm", "b.apgm", "out.apgm"}));
    EXPECT_THAT(outcome.err, HasSubstr("\r\x1b[2K"));
    EXPECT_THAT(outcome.err, HasSubstr("apgm-merge: error: interrupted\n"));
  }
};

TEST_F(LongMergeTest, InterruptLeavesTheOldOutputAndNoOtherFile) { expect_ended_by(SIGINT); }

TEST_F(LongMergeTest, TerminationLeavesTheOldOutputAndNoOtherFile) { expect_ended_by(SIGTERM); }

}  // namespace
}  // namespace apgm::test
