#include "cli_test.hpp"

namespace apgm::test {
namespace {

class ArchiveCliTest : public CliTest {
 protected:
  void SetUp() override {
    Map map = plain_map(20, 20);
    write("one.apgm", map);
    map.layer({3, 4}, 0, 3).plane(0)[5] = 0.125f;
    map.extract({0, 0}, 0);
    write("two.apgm", map);
    map.layer({30, 30}, 0, 3).plane(0)[5] = 0.125f;
    write("three.apgm", map);
  }
  Outcome archive(std::vector<std::string> arguments) const { return tool("archive", arguments); }
  Json json(std::vector<std::string> arguments) const {
    arguments.push_back("--json");
    const Outcome outcome = archive(arguments);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return Json::parse(outcome.out, nullptr, false);
  }
  void commit_all() const {
    expect_silent(archive({"commit", "a.apgm", "one.apgm", "-m", "first", "--stamp", "@1000"}));
    expect_silent(archive({"commit", "a.apgm", "two.apgm", "-m", "second\nmore", "--stamp", "@2000"}));
    expect_silent(archive({"commit", "a.apgm", "three.apgm", "--tag", "last.one", "--stamp", "@3000"}));
  }
};

TEST_F(ArchiveCliTest, CheckoutGivesWhatWasCommitted) {
  for (const char* name : {"one", "two", "three"}) {
    const std::string map = std::string(name) + ".apgm";
    expect_silent(archive({"commit", "a.apgm", map}));
    expect_silent(archive({"checkout", "a.apgm", "-o", "out.apgm", "-O"}));
    EXPECT_EQ(bytes("out.apgm"), bytes(map));
  }
  expect_silent(archive({"checkout", "a.apgm", "--at", "1", "-o", "out.apgm", "-O"}));
  EXPECT_EQ(bytes("out.apgm"), bytes("one.apgm"));
}

TEST_F(ArchiveCliTest, EveryToolReadsTheLastCommit) {
  commit_all();
  EXPECT_EQ(info("a.apgm")["content_id"], info("three.apgm")["content_id"]);
  expect_silent(tool("crop", {"a.apgm", "--bbox", "0,0,20,20", "-o", "part.apgm"}));
  EXPECT_EQ(bytes("part.apgm").find("apgm.archive"), std::string::npos);
}

TEST_F(ArchiveCliTest, InfoTellsOfTheCommitsAndTheLast) {
  commit_all();
  EXPECT_THAT(tool("info", {"a.apgm"}).out, HasSubstr("3 commits (last: 3)\n"));
  expect_silent(archive({"commit", "a.apgm", "one.apgm", "-m", "back\nagain"}));
  const Outcome outcome = tool("info", {"a.apgm"});
  EXPECT_EQ(outcome.err, "");
  EXPECT_THAT(outcome.out, HasSubstr("4 commits (last: 4, back ...)\n"));
  EXPECT_EQ(archive({"compact", "a.apgm", "--keep", "2"}).code, 0);
  const Json file = info("a.apgm")["file"];
  EXPECT_EQ(file["archive"], true);
  EXPECT_EQ(file["commits"], 2);
  EXPECT_EQ(file["commit"], 4);
  EXPECT_EQ(file["message"], "back\nagain");
  EXPECT_EQ(file["uncommitted_bytes"], 0);
}

TEST_F(ArchiveCliTest, InfoAndRenderWarnOfATornEnd) {
  commit_all();
  put("a.apgm", bytes("a.apgm") + std::string(1000, 'x'));
  const char* warning =
      "warning: 'a.apgm' ends with 1000 bytes of a commit that is not whole; commit 3 is read";
  const Outcome told = tool("info", {"--json", "a.apgm"});
  EXPECT_EQ(told.code, 0);
  EXPECT_THAT(told.err, HasSubstr(warning));
  EXPECT_EQ(Json::parse(told.out)["file"]["uncommitted_bytes"], 1000);
  const Outcome drawn = tool("render", {"a.apgm", "-o", "a.png"});
  EXPECT_EQ(drawn.code, 0);
  EXPECT_THAT(drawn.err, HasSubstr(warning));
}

TEST_F(ArchiveCliTest, CommitTellsWhatItStored) {
  const Json first = json({"commit", "a.apgm", "one.apgm"});
  EXPECT_EQ(first["commit"], 1);
  EXPECT_EQ(first["layers_written"], 400);
  const Json dry = json({"commit", "-n", "a.apgm", "two.apgm"});
  EXPECT_EQ(dry["layers_written"], 1);
  EXPECT_EQ(dry["layers_gone"], 1);
  const Json second = json({"commit", "a.apgm", "two.apgm"});
  EXPECT_EQ(second["commit"], 2);
  EXPECT_EQ(second["layers"], 399);
  EXPECT_EQ(second["layers_written"], 1);
  EXPECT_LT(second["added_bytes"].get<int>() * 2, first["added_bytes"].get<int>());
}

TEST_F(ArchiveCliTest, LogIsATableAndADocument) {
  commit_all();
  const Outcome outcome = archive({"log", "a.apgm"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.out, HasSubstr("1970-01-01T00:33:20Z"));
  EXPECT_THAT(outcome.out, HasSubstr("second ..."));
  EXPECT_LT(outcome.out.find("last.one"), outcome.out.find("first"));
  const Json commits = json({"log", "a.apgm"})["commits"];
  ASSERT_EQ(commits.size(), 3u);
  EXPECT_EQ(commits[1]["message"], "second\nmore");
  EXPECT_EQ(commits[2]["tags"], Json::array({"last.one"}));
  EXPECT_EQ(commits[0]["stamp_ns"], 1'000'000'000'000);
  EXPECT_EQ(json({"log", "one.apgm"})["commits"].size(), 1u);
}

TEST_F(ArchiveCliTest, CheckoutByNumberTagAndTime) {
  commit_all();
  const auto number = [&](const std::string& at) {
    return json({"checkout", "a.apgm", "--at", at, "-n", "-o", "out.apgm"})["commit"];
  };
  EXPECT_EQ(number("2"), 2);
  EXPECT_EQ(number("last.one"), 3);
  EXPECT_EQ(number("@2999"), 2);
  EXPECT_EQ(number("@3000"), 3);
  EXPECT_EQ(number("1970-01-01T00:16:40Z"), 1);
  EXPECT_EQ(number("now"), 3);
  const auto refused = [&](const std::string& at, const std::string& message) {
    expect_failure(archive({"checkout", "a.apgm", "--at", at, "-o", "out.apgm"}), 2, message);
    EXPECT_FALSE(exists("out.apgm"));
  };
  refused("4", "'a.apgm' has no commit 4");
  refused("0", "--at");
  refused("gone", "'a.apgm' has no tag 'gone'");
  refused("@999", "'a.apgm' has no commit as early as @999");
  refused("2026-13-01", "--at");
}

TEST_F(ArchiveCliTest, TagsComeAndGo) {
  commit_all();
  expect_silent(archive({"tag", "a.apgm", "good", "2"}));
  expect_silent(archive({"tag", "a.apgm", "newest"}));
  EXPECT_EQ(json({"log", "a.apgm"})["commits"][1]["tags"], Json::array({"good"}));
  expect_silent(archive({"tag", "--delete", "a.apgm", "good"}));
  EXPECT_EQ(json({"log", "a.apgm"})["commits"][1]["tags"], Json::array());
  expect_failure(archive({"tag", "--delete", "a.apgm", "good"}), 2, "'a.apgm' has no tag 'good'");
  expect_failure(archive({"tag", "a.apgm", "2good"}), 2, "NAME: '2good' cannot be a tag");
  expect_failure(archive({"tag", "a.apgm", "x", "9"}), 2, "'a.apgm' has no commit 9");
}

TEST_F(ArchiveCliTest, CompactInPlaceAndElsewhere) {
  commit_all();
  expect_silent(archive({"tag", "a.apgm", "start", "1"}));
  const Json report = json({"compact", "--keep", "1", "a.apgm", "-o", "small.apgm"});
  EXPECT_EQ(report["commits"], 2);
  EXPECT_EQ(report["commits_before"], 3);
  expect_failure(archive({"compact", "a.apgm", "-o", "small.apgm"}), 5, "'small.apgm' already exists");
  expect_silent(archive({"compact", "--keep", "1", "a.apgm"}));
  EXPECT_EQ(bytes("a.apgm"), bytes("small.apgm"));
  expect_silent(archive({"checkout", "a.apgm", "--at", "start", "-o", "out.apgm"}));
  EXPECT_EQ(info("out.apgm")["content_id"], info("one.apgm")["content_id"]);
}

TEST_F(ArchiveCliTest, ExpectStopsTheSecondOfTwo) {
  expect_silent(archive({"commit", "--expect", "0", "a.apgm", "one.apgm"}));
  expect_silent(archive({"commit", "--expect", "1", "a.apgm", "two.apgm"}));
  const std::string before = bytes("a.apgm");
  expect_failure(archive({"commit", "--expect", "1", "a.apgm", "three.apgm"}), 7,
                 "the last commit of 'a.apgm' is 2, not 1");
  EXPECT_EQ(bytes("a.apgm"), before);
}

TEST_F(ArchiveCliTest, RefusesWhatDoesNotFit) {
  commit_all();
  const std::string before = bytes("a.apgm");
  Frame frame;
  frame.datum_x_um = 5'000'000;
  write("moved.apgm", plain_map(2, 2, frame));
  expect_failure(archive({"commit", "a.apgm", "moved.apgm"}), 7, "frame");
  expect_failure(archive({"commit", "one.apgm", "two.apgm"}), 7,
                 "'one.apgm' is a sealed map, not an archive");
  expect_failure(archive({"commit", "a.apgm", "missing.apgm"}), 4, "cannot open 'missing.apgm'");
  expect_failure(archive({"commit", "b.apgm", "missing.apgm"}), 4, "cannot open 'missing.apgm'");
  expect_failure(archive({"commit", "a.apgm", "a.apgm"}), 2, "ARCHIVE and MAP are the same file");
  expect_failure(archive({"commit", "a.apgm"}), 2, "commit needs MAP");
  expect_failure(archive({"log", "a.apgm", "b.apgm"}), 2, "unexpected argument 'b.apgm'");
  expect_failure(archive({"compact", "-"}), 2, "an archive that is written to must be a file");
  expect_failure(archive({"comit", "a.apgm", "b.apgm"}), 2, "unknown command 'comit'", "'commit'");
  expect_failure(archive({"tag", "missing.apgm", "x"}), 5, "cannot open 'missing.apgm'");
  EXPECT_EQ(bytes("a.apgm"), before);
  EXPECT_FALSE(exists("b.apgm"));
}

TEST_F(ArchiveCliTest, ATornEndIsAWarning) {
  commit_all();
  put("a.apgm", bytes("a.apgm") + std::string(1000, 'x'));
  const Outcome outcome = archive({"checkout", "a.apgm", "-o", "out.apgm"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("warning: 'a.apgm' ends with 1000 bytes of a commit that is not whole"));
  EXPECT_EQ(info("out.apgm")["content_id"], info("three.apgm")["content_id"]);
  EXPECT_THAT(archive({"commit", "a.apgm", "three.apgm"}).err, HasSubstr("cut 1 000 bytes"));
  expect_silent(archive({"checkout", "a.apgm", "-o", "out.apgm", "-O"}));
}

TEST_F(ArchiveCliTest, AFullDiskLeavesTheArchive) {
  commit_all();
  const std::string before = bytes("a.apgm");
  write_random("large.apgm", 3);
  const Outcome outcome = run({"/bin/sh", "-c",
                               "ulimit -f " + std::to_string(before.size() / 512 + 1) + "; exec " +
                                   command("archive", {})[0] + " commit a.apgm large.apgm"},
                              [&] {
                                Launch launch;
                                launch.directory = directory_.path();
                                return launch;
                              }());
  EXPECT_EQ(outcome.code, 5) << outcome.err;
  EXPECT_EQ(bytes("a.apgm"), before);
}

TEST_F(ArchiveCliTest, EveryCommandHasItsHelp) {
  for (const char* command : {"commit", "log", "checkout", "compact", "tag"}) {
    const Outcome outcome = archive({command, "--help"});
    EXPECT_EQ(outcome.code, 0);
    EXPECT_THAT(outcome.out, HasSubstr(std::string("usage: apgm-archive ") + command));
    for (std::size_t from = 0; from < outcome.out.size();) {
      const std::size_t end = outcome.out.find('\n', from);
      EXPECT_LE(end - from, 100u) << outcome.out.substr(from, end - from);
      from = end + 1;
    }
  }
}

}  // namespace
}  // namespace apgm::test
