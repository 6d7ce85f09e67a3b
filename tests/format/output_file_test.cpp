#include "apgm/format/output_file.hpp"

#include <gmock/gmock.h>
#include <grp.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <utility>

#include "apgm/core/error.hpp"
#include "temp_dir.hpp"

namespace apgm {
namespace {

using test::read_file;
using test::TempDir;
using test::write_file;

constexpr uid_t kNobody = 65534;

struct stat status_of(const std::string& path) {
  struct stat st {};
  EXPECT_EQ(::stat(path.c_str(), &st), 0) << path;
  return st;
}

/// Does work in a process without the rights of root.
void as_nobody(const std::function<void()>& work) {
  const pid_t child = ::fork();
  if (child == 0) {
    EXPECT_EQ(::setgroups(0, nullptr), 0);
    EXPECT_EQ(::setgid(kNobody), 0);
    EXPECT_EQ(::setuid(kNobody), 0);
    ::prctl(PR_SET_DUMPABLE, 1);  // as a program that was started so: /proc/self is its own
    work();
    std::fflush(stdout);
    ::_exit(testing::Test::HasFailure() ? 1 : 0);
  }
  int status = -1;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
}

void replace(const std::string& path) {
  OutputFile file(path, {.overwrite = true});
  file.write("new");
  file.commit();
}

ErrorCode code_of(const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& e) {
    return e.code();
  }
  ADD_FAILURE() << "no error";
  return ErrorCode::kCancelled;
}

TEST(OutputFileTest, AppearsWhenCommitted) {
  TempDir dir;
  OutputFile file(dir / "a");
  file.write("hello");
  EXPECT_TRUE(dir.list().empty());
  file.commit();
  EXPECT_EQ(read_file(dir / "a"), "hello");
  EXPECT_THAT(dir.list(), testing::ElementsAre("a"));
}

TEST(OutputFileTest, DroppedFileLeavesTheOldOne) {
  TempDir dir;
  write_file(dir / "a", "old");
  {
    OutputFile file(dir / "a", {.overwrite = true});
    file.write(std::string(1 << 20, 'x'));
  }
  EXPECT_EQ(read_file(dir / "a"), "old");
  EXPECT_THAT(dir.list(), testing::ElementsAre("a"));
}

TEST(OutputFileTest, ReplacesOnlyWhenAskedAndKeepsTheMode) {
  TempDir dir;
  write_file(dir / "a", "old");
  ::chmod((dir / "a").c_str(), 0640);
  EXPECT_EQ(code_of([&] { OutputFile file(dir / "a"); }), ErrorCode::kOutput);
  OutputFile file(dir / "a", {.overwrite = true, .fsync = true});
  file.write("new");
  file.commit();
  EXPECT_EQ(read_file(dir / "a"), "new");
  struct stat st {};
  ::stat((dir / "a").c_str(), &st);
  EXPECT_EQ(st.st_mode & 0777, 0640u);
  EXPECT_THAT(dir.list(), testing::ElementsAre("a"));
}

TEST(OutputFileTest, AReplacedFileKeepsOwnerAndGroup) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root gives files away";
  TempDir dir;
  write_file(dir / "a", "old");
  ASSERT_EQ(::chown((dir / "a").c_str(), kNobody, 12), 0);
  ASSERT_EQ(::chmod((dir / "a").c_str(), 06750), 0);
  replace(dir / "a");
  const struct stat st = status_of(dir / "a");
  EXPECT_EQ(std::pair(st.st_uid, st.st_gid), std::pair(kNobody, gid_t{12}));
  EXPECT_EQ(st.st_mode & 07777, 06750u);
  EXPECT_EQ(read_file(dir / "a"), "new");
}

TEST(OutputFileTest, WhoMayNotGiveAFileAwayGetsNoRightsOfItsOwner) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root makes files of others";
  TempDir dir;
  ASSERT_EQ(::chmod(dir.path().c_str(), 0777), 0);
  write_file(dir / "a", "old");
  ASSERT_EQ(::chmod((dir / "a").c_str(), 06777), 0);
  as_nobody([&] { replace(dir / "a"); });
  const struct stat st = status_of(dir / "a");
  EXPECT_EQ(std::pair(st.st_uid, st.st_gid), std::pair(kNobody, gid_t{kNobody}));
  EXPECT_EQ(st.st_mode & 07777, 0777u);
}

TEST(OutputFileTest, ADirectoryThatMayNotBeWrittenIsNamed) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root becomes another";
  TempDir dir;
  ASSERT_EQ(::chmod(dir.path().c_str(), 0755), 0);
  write_file(dir / "a", "old");
  ASSERT_EQ(::chmod((dir / "a").c_str(), 0666), 0);
  as_nobody([&] {
    try {
      replace(dir / "a");
      ADD_FAILURE() << "no error";
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::kOutput);
      EXPECT_EQ(e.message(), "cannot make a temporary file beside '" + dir / "a" + "', in directory '" +
                                 std::string(dir.path()) + "': Permission denied");
      EXPECT_THAT(e.hint(), testing::HasSubstr("you must be allowed to write to the directory"));
    }
  });
  EXPECT_EQ(read_file(dir / "a"), "old");
}

TEST(OutputFileTest, DoesNotReplaceAFileThatAppearedMeanwhile) {
  TempDir dir;
  OutputFile file(dir / "a");
  file.write("mine");
  write_file(dir / "a", "theirs");
  EXPECT_EQ(code_of([&] { file.commit(); }), ErrorCode::kOutput);
  EXPECT_EQ(read_file(dir / "a"), "theirs");
}

TEST(OutputFileTest, FollowsALinkToTheFileItNames) {
  TempDir dir;
  write_file(dir / "real", "old");
  ASSERT_EQ(::symlink((dir / "real").c_str(), (dir / "link").c_str()), 0);
  OutputFile file(dir / "link", {.overwrite = true});
  file.write("new");
  file.commit();
  EXPECT_EQ(read_file(dir / "real"), "new");
  struct stat st {};
  ::lstat((dir / "link").c_str(), &st);
  EXPECT_TRUE(S_ISLNK(st.st_mode));
}

TEST(OutputFileTest, MakesTheFileADanglingLinkNames) {
  TempDir dir;
  ASSERT_EQ(::symlink("real", (dir / "link").c_str()), 0);
  OutputFile file(dir / "link");
  file.write("new");
  file.commit();
  EXPECT_EQ(read_file(dir / "real"), "new");
  ASSERT_EQ(::symlink("loop", (dir / "loop").c_str()), 0);
  EXPECT_EQ(code_of([&] { OutputFile loop(dir / "loop"); }), ErrorCode::kOutput);
}

TEST(OutputFileTest, FullDiskIsToldByFlush) {
  OutputFile file("/dev/full");
  file.write("a little");
  EXPECT_EQ(code_of([&] { file.flush(); }), ErrorCode::kOutput);
}

TEST(OutputFileTest, FullDiskIsAnOutputError) {
  EXPECT_EQ(code_of([&] {
              OutputFile file("/dev/full");
              file.write(std::string(1 << 20, 'x'));
              file.commit();
            }),
            ErrorCode::kOutput);
}

TEST(OutputFileTest, DirectoriesAndMissingDirectoriesAreOutputErrors) {
  TempDir dir;
  EXPECT_EQ(code_of([&] { OutputFile file(dir.path()); }), ErrorCode::kOutput);
  EXPECT_EQ(code_of([&] { OutputFile file(dir / "no/such/a"); }), ErrorCode::kOutput);
}

TEST(CheckNotAnInputTest, TellsTheSameFileByAnyName) {
  TempDir dir;
  write_file(dir / "a", "x");
  ASSERT_EQ(::symlink((dir / "a").c_str(), (dir / "b").c_str()), 0);
  const std::vector<std::string> inputs{dir / "a"};
  EXPECT_EQ(code_of([&] { check_not_an_input(dir / "b", inputs); }), ErrorCode::kInvalidArgument);
  EXPECT_NO_THROW(check_not_an_input(dir / "c", inputs));
}

}  // namespace
}  // namespace apgm
