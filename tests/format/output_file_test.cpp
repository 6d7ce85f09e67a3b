#include "apgm/format/output_file.hpp"

#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include "apgm/core/error.hpp"
#include "temp_dir.hpp"

namespace apgm {
namespace {

using test::read_file;
using test::TempDir;
using test::write_file;

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
