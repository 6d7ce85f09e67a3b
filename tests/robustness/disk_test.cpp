#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "writers.hpp"

namespace apgm::test {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

const Workshop& workshop() {
  static const Workshop shop(4);
  return shop;
}

class DiskTest : public testing::TestWithParam<WriterCommand> {
 protected:
  /// Runs the command through a shell that says `before` first.
  Outcome run_after(const std::string& before) const {
    std::string script = before + "; exec";
    for (const std::string& word : workshop().line(GetParam())) script += " '" + word + "'";
    Launch launch;
    launch.directory = workshop().directory();
    return run({"/bin/sh", "-c", script}, launch);
  }

  /// The outputs moved to another directory.
  static WriterCommand moved(WriterCommand command, const std::string& directory) {
    for (std::string& word : command.arguments) {
      if (word.starts_with("out.")) word = directory + "/" + word;
    }
    return command;
  }

  void expect_untouched(const Outcome& outcome) const {
    EXPECT_EQ(outcome.code, 5) << outcome.err;
    EXPECT_THAT(workshop().strangers(GetParam()), IsEmpty());
    EXPECT_TRUE(workshop().outputs(GetParam()) == workshop().old(GetParam()));
  }
};

TEST_P(DiskTest, FilesThatGrowTooLarge) {
  workshop().put_old(GetParam());
  const Outcome outcome = run_after("ulimit -f 1");
  expect_untouched(outcome);
  EXPECT_THAT(outcome.err, HasSubstr("File too large"));
}

TEST_P(DiskTest, FullDisk) {
  const TempDir disk;
  if (::mount("apgm-test", disk.path().c_str(), "tmpfs", 0, "size=4k") != 0) {
    GTEST_SKIP() << "cannot mount a small disk: " << std::strerror(errno);
  }
  const Outcome outcome = workshop().run(moved(GetParam(), disk.path()));
  EXPECT_EQ(outcome.code, 5) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("space"));
  EXPECT_THAT(disk.list(), IsEmpty());
  ::umount2(disk.path().c_str(), MNT_DETACH);
}

TEST_P(DiskTest, DirectoriesThatMayNotBeWritten) {
  const TempDir locked;
  std::filesystem::permissions(locked.path(), std::filesystem::perms(0555));
  const WriterCommand command = moved(GetParam(), locked.path());
  std::vector<std::string> line = workshop().line(command);
  if (::geteuid() == 0) {
    if (::access("/usr/bin/setpriv", X_OK) != 0) GTEST_SKIP() << "root may write anywhere";
    std::filesystem::permissions(workshop().directory(), std::filesystem::perms(0755));
    line.insert(line.begin(), {"/usr/bin/setpriv", "--reuid=65534", "--clear-groups"});
  }
  Launch launch;
  launch.directory = workshop().directory();
  const Outcome outcome = run(line, launch);
  if (outcome.code == 127 || outcome.code == 126) GTEST_SKIP() << "the tools lie where others may not go";
  EXPECT_EQ(outcome.code, 5) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("Permission denied"));
  EXPECT_THAT(locked.list(), IsEmpty());
  std::filesystem::permissions(locked.path(), std::filesystem::perms(0755));
}

INSTANTIATE_TEST_SUITE_P(Writers, DiskTest, testing::ValuesIn(writer_commands()),
                         [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace apgm::test
