#include <sys/stat.h>
#include <unistd.h>

#include <cstring>
#include <memory>
#include <optional>

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
  /// Run without the rights of root, in a directory that may be read and not be written; none if that cannot
  /// be.
  std::optional<Outcome> as_nobody(const std::string& verb, const std::vector<std::string>& arguments) const {
    std::filesystem::permissions(directory_.path(), std::filesystem::perms(0555));
    std::vector<std::string> line = command(verb, arguments);
    if (::geteuid() == 0) {
      if (::access("/usr/bin/setpriv", X_OK) != 0) return {};
      line.insert(line.begin(), {"/usr/bin/setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"});
    }
    Launch launch;
    launch.directory = directory_.path();
    const Outcome outcome = run(line, launch);
    std::filesystem::permissions(directory_.path(), std::filesystem::perms(0755));
    if (outcome.code == 127 || outcome.code == 126) return {};  // the tools lie where others may not go
    return outcome;
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

TEST_F(ArchiveCliTest, TheTimeZeroIsNone) {
  const char* message = "--stamp: a map cannot hold the time 0, which says that there is none";
  for (const char* zero : {"@0", "1970-01-01T00:00:00Z"}) {
    expect_failure(archive({"commit", "a.apgm", "one.apgm", "--stamp", zero}), 2, message,
                   "leave --stamp out");
  }
  EXPECT_FALSE(exists("a.apgm"));
}

TEST_F(ArchiveCliTest, ATimeBeforeThatOfTheLastCommitIsAWarning) {
  commit_all();
  const char* warning =
      "warning: the time of commit 4 (1970-01-01T00:41:40Z) is before that of commit 3 "
      "(1970-01-01T00:50:00Z): no time given with --at finds commit 3 any more";
  const std::vector<std::string> early{"commit", "a.apgm", "one.apgm", "--stamp", "@2500"};
  for (const bool dry : {true, false}) {
    std::vector<std::string> arguments = early;
    if (dry) arguments.emplace_back("-n");
    const Outcome outcome = archive(arguments);
    EXPECT_EQ(outcome.code, 0);
    EXPECT_THAT(outcome.err, HasSubstr(warning));
  }
  EXPECT_EQ(json({"checkout", "a.apgm", "--at", "@9999", "-n", "-o", "out.apgm"})["commit"], 4);
  EXPECT_EQ(json({"checkout", "a.apgm", "--at", "@2499", "-n", "-o", "out.apgm"})["commit"], 2);
  // A commit without a time is not before any, and none is before it.
  expect_silent(archive({"commit", "a.apgm", "one.apgm"}));
  expect_silent(archive({"commit", "a.apgm", "two.apgm", "--stamp", "@1"}));
}

TEST_F(ArchiveCliTest, OperandsThatCannotBeUsedAreNamed) {
  commit_all();
  expect_failure(archive({"tag", "a.apgm", ""}), 2, "NAME is an empty text");
  expect_failure(archive({"tag", "", "x"}), 2, "ARCHIVE is an empty text");
  expect_failure(archive({"tag", "a.apgm", "x", "-1"}), 2, "unknown option '-1'", "a number below 0");
  put("empty.apgm", "");
  for (const std::string command : {"commit", "tag"}) {
    expect_failure(archive({command, "empty.apgm", "one.apgm"}), 4,
                   "'empty.apgm' is not an archive: it is empty",
                   "remove it: 'apgm-archive commit' makes an archive");
  }
}

TEST_F(ArchiveCliTest, WhatStandsForATimeOrANumberIsNoTag) {
  commit_all();
  const std::string before = bytes("a.apgm");
  for (const char* tag : {"now", "12", "@5", "2026-01-31T12:00:00Z"}) {
    expect_failure(archive({"tag", "a.apgm", tag}), 2, "cannot be a tag");
    expect_failure(archive({"commit", "a.apgm", "one.apgm", "--tag", tag}), 2, "cannot be a tag");
  }
  expect_failure(archive({"tag", "a.apgm", "now"}), 2, "NAME: 'now' cannot be a tag", "--at now is a time");
  // One that an older version gave away stands no more for its commit, and can be taken away.
  expect_failure(archive({"tag", "--delete", "a.apgm", "now"}), 2, "'a.apgm' has no tag 'now'");
  EXPECT_EQ(bytes("a.apgm"), before);
}

TEST_F(ArchiveCliTest, CheckoutSalvagesAnOldCommit) {
  commit_all();
  std::string damaged = bytes("a.apgm");
  std::uint64_t payload = 0;
  std::memcpy(&payload, damaged.data() + 64 + 16, 8);
  // The first layer of the first commit is patch (0,0), which the second commit takes away.
  char& byte = damaged[64 + 64 + (payload + 7) / 8 * 8 + 70];
  byte = static_cast<char>(byte ^ 1);
  put("a.apgm", damaged);
  expect_failure(archive({"checkout", "a.apgm", "--at", "1", "-o", "out.apgm"}), 4,
                 "patch (0,0) layer 'occupancy'", "--salvage keeps the layers of the commit");
  const Outcome outcome =
      archive({"checkout", "a.apgm", "--at", "1", "--salvage", "-o", "out.apgm", "--json"});
  EXPECT_EQ(outcome.code, 3) << outcome.err;
  EXPECT_EQ(Json::parse(outcome.out)["layers_left_out"], 1);
  EXPECT_EQ(info("out.apgm")["map"]["patches"], 399);
  expect_silent(archive({"checkout", "a.apgm", "--salvage", "-o", "last.apgm"}));
  expect_silent(archive({"checkout", "a.apgm", "-o", "plain.apgm"}));
  EXPECT_TRUE(bytes("last.apgm") == bytes("plain.apgm"));
  expect_failure(archive({"compact", "a.apgm"}), 4, "patch (0,0) layer 'occupancy'",
                 "checkout --salvage --at 1'");
  const Outcome verified = tool("verify", {"a.apgm"});
  EXPECT_EQ(verified.code, 1);
  EXPECT_THAT(verified.out, HasSubstr("apgm-archive checkout --salvage --at N those of an older one"));
}

TEST_F(ArchiveCliTest, ControlCharactersOfAMessageAreShown) {
  const std::string message = "red \x1b[31m bell\x07 del\x7f csi \xc2\x9b umlaut \xc3\xa4\nmore";
  expect_silent(archive({"commit", "a.apgm", "one.apgm", "-m", message}));
  const Outcome log = archive({"log", "a.apgm"});
  EXPECT_THAT(log.out, HasSubstr("red \\x1b[31m bell\\x07 del\\x7f csi \\xc2\\x9b umlaut \xc3\xa4 ..."));
  EXPECT_EQ(log.out.find('\x1b'), std::string::npos);
  const Outcome document = archive({"log", "a.apgm", "--json"});
  EXPECT_THAT(document.out, HasSubstr("red \\u001b[31m bell\\u0007"));
  EXPECT_EQ(document.out.find('\x1b'), std::string::npos);
  EXPECT_EQ(Json::parse(document.out)["commits"][0]["message"], message);
}

TEST_F(ArchiveCliTest, OnlyRegularFilesAreArchives) {
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  for (const std::string file : {"/dev/null", "pipe"}) {
    expect_failure(archive({"commit", file, "one.apgm"}), 5, "'" + file + "' is not a regular file");
    expect_failure(archive({"commit", "-n", file, "one.apgm"}), 5, "'" + file + "' is not a regular file");
    expect_failure(archive({"tag", file, "x"}), 5, "'" + file + "' is not a regular file");
    expect_failure(archive({"compact", file}), 5, "'" + file + "' is not a regular file");
  }
  commit_all();
  for (const std::string file : {"/dev/null", "/dev/full", "pipe"}) {
    expect_failure(archive({"compact", "a.apgm", "-o", file, "-O"}), 5,
                   "'" + file + "' is not a regular file", "an archive is a file on a disk");
  }
}

TEST_F(ArchiveCliTest, CompactWithinABudget) {
  commit_all();
  const std::string before = bytes("a.apgm");
  expect_failure(archive({"compact", "--max-memory", "1M", "a.apgm"}), 6, "is held in memory",
                 "pass --max-memory with at least ");
  EXPECT_EQ(bytes("a.apgm"), before);
  expect_silent(archive({"compact", "--max-memory", "64M", "a.apgm"}));
  EXPECT_EQ(json({"log", "a.apgm"})["commits"].size(), 3u);
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
  expect_failure(archive({"commit", "--expect", "1", "new.apgm", "three.apgm"}), 7,
                 "there is no archive 'new.apgm', its last commit was to be 1", "expect 0, or nothing");
  EXPECT_FALSE(exists("new.apgm"));
}

TEST_F(ArchiveCliTest, MoreCommitsExpectedThanThereAreSomeAreMissing) {
  expect_silent(archive({"commit", "a.apgm", "one.apgm"}));
  expect_failure(archive({"commit", "--expect", "0", "a.apgm", "two.apgm"}), 7,
                 "the last commit of 'a.apgm' is 1, not 0", "somebody committed in between");
  expect_failure(archive({"commit", "--expect", "2", "a.apgm", "two.apgm"}), 7,
                 "the last commit of 'a.apgm' is 1, not 2",
                 "commits are missing at its end: they were torn off, or this is another file; "
                 "'apgm-verify a.apgm' tells more, 'apgm-verify --recover' saves");
}

TEST_F(ArchiveCliTest, ADryRunRefusesWhatTheCommitWould) {
  commit_all();
  const std::set<std::string> before_files = files();
  const std::string before = bytes("a.apgm");
  const auto refused = [&](std::vector<std::string> arguments, int code, const std::string& message) {
    arguments.insert(arguments.begin(), "commit");
    expect_failure(archive(arguments), code, message);
    arguments.insert(arguments.begin() + 1, "-n");
    expect_failure(archive(arguments), code, message);
  };
  refused({"--expect", "2", "a.apgm", "one.apgm"}, 7, "the last commit of 'a.apgm' is 3, not 2");
  refused({"--expect", "1", "b.apgm", "one.apgm"}, 7, "there is no archive 'b.apgm'");
  refused({"--tag", "1st", "a.apgm", "one.apgm"}, 2, "--tag: '1st' cannot be a tag");
  refused({"-m", "\xff", "a.apgm", "one.apgm"}, 2, "--message: the text is not UTF-8");
  refused({"one.apgm", "two.apgm"}, 7, "'one.apgm' is a sealed map, not an archive");
  refused({"no/a.apgm", "one.apgm"}, 5, "directory 'no': No such file or directory");
  EXPECT_EQ(files(), before_files);
  EXPECT_EQ(bytes("a.apgm"), before);
  expect_silent(archive({"commit", "-n", "--expect", "3", "a.apgm", "one.apgm"}));
  expect_silent(archive({"commit", "-n", "--expect", "0", "b.apgm", "one.apgm"}));
  EXPECT_EQ(files(), before_files);
  EXPECT_EQ(bytes("a.apgm"), before);
}

TEST_F(ArchiveCliTest, WhatMayNotBeWrittenIsToldByADryRunToo) {
  commit_all();
  std::filesystem::permissions(path("a.apgm"), std::filesystem::perms(0444));
  for (const bool dry : {true, false}) {
    std::vector<std::string> arguments{"commit", "a.apgm", "one.apgm"};
    if (dry) arguments.insert(arguments.begin() + 1, "-n");
    const std::optional<Outcome> outcome = as_nobody("archive", arguments);
    if (!outcome) GTEST_SKIP() << "root may write anywhere, and none other may be there";
    expect_failure(*outcome, 5, "cannot open 'a.apgm': Permission denied");
  }
}

TEST_F(ArchiveCliTest, CompactNeedsTheDirectory) {
  commit_all();
  const std::string before = bytes("a.apgm");
  std::filesystem::permissions(path("a.apgm"), std::filesystem::perms(0666));
  const std::optional<Outcome> outcome = as_nobody("archive", {"compact", "a.apgm"});
  if (!outcome) GTEST_SKIP() << "root may write anywhere, and none other may be there";
  expect_failure(*outcome, 5,
                 "cannot make a temporary file beside 'a.apgm', in directory '.': Permission denied",
                 "you must be allowed to write to the directory");
  EXPECT_EQ(bytes("a.apgm"), before);
}

TEST_F(ArchiveCliTest, WhoLosesARaceForANewArchiveIsToldToTryAgain) {
  for (int round = 0; round < 5; ++round) {
    const std::string file = "race" + std::to_string(round) + ".apgm";
    Launch launch;
    launch.directory = directory_.path();
    std::vector<std::unique_ptr<Process>> writers;
    for (int i = 0; i < 6; ++i) {
      writers.push_back(std::make_unique<Process>(command("archive", {"commit", file, "one.apgm"}), launch));
    }
    std::size_t won = 0;
    for (const auto& writer : writers) {
      const Outcome outcome = writer->wait();
      if (outcome.code == 0) {
        ++won;
      } else {
        expect_failure(outcome, 5, "another process writes to '" + file + "'", "try again");
      }
    }
    ASSERT_GE(won, 1u);
    EXPECT_EQ(json({"log", file})["commits"].size(), won);
  }
}

TEST_F(ArchiveCliTest, RefusesWhatDoesNotFit) {
  commit_all();
  const std::string before = bytes("a.apgm");
  Frame frame;
  frame.datum_x_um = 5'000'000;
  write("moved.apgm", plain_map(2, 2, frame));
  const char* difference = "'moved.apgm' has another frame than 'a.apgm': datums differ (5,0 m and 0,0 m)";
  expect_failure(archive({"commit", "a.apgm", "moved.apgm"}), 7, difference);
  expect_failure(archive({"commit", "-n", "a.apgm", "moved.apgm"}), 7, difference);
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
  EXPECT_THAT(outcome.err, HasSubstr("hint: raise the limit of file sizes"));
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
