#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <string>

#include "apgm/format/reader.hpp"
#include "temp_dir.hpp"

namespace apgm {
namespace {

using testing::HasSubstr;

struct Outcome {
  int code = -1;
  std::string output;  // stdout and stderr
};

Outcome run(const std::string& command) {
  Outcome outcome;
  FILE* pipe = ::popen((std::string(APGM_SAMPLES_DIR) + "/" + command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return outcome;
  std::array<char, 4096> buffer{};
  while (const std::size_t n = std::fread(buffer.data(), 1, buffer.size(), pipe))
    outcome.output.append(buffer.data(), n);
  const int status = ::pclose(pipe);
  if (WIFEXITED(status)) outcome.code = WEXITSTATUS(status);
  return outcome;
}

TEST(SampleProgramsTest, ExamplesRunOneAfterTheOther) {
  const test::TempDir dir;
  const std::string map = dir / "wall.apgm";
  const Outcome made = run("01_make_a_map " + map);
  EXPECT_EQ(made.code, 0) << made.output;
  EXPECT_THAT(made.output, HasSubstr("2 patches"));

  const Outcome counted = run("03_stream_a_file " + map);
  EXPECT_EQ(counted.code, 0) << counted.output;
  EXPECT_THAT(counted.output, HasSubstr("100 occupied cells, 1.0 m2"));

  // The wall twice: .9 and .9 give .99.
  const Outcome fused = run("02_fuse_two_maps " + map + " " + map + " 570006.05 5360005.05");
  EXPECT_EQ(fused.code, 0) << fused.output;
  EXPECT_THAT(fused.output, HasSubstr("patches 2 + 2 -> 2"));
  EXPECT_THAT(fused.output, HasSubstr("m(O) 0.9900  m(F) 0.0000"));
}

TEST(SampleProgramsTest, ExamplesTellWhatIsWrong) {
  const test::TempDir dir;
  EXPECT_EQ(run("01_make_a_map").code, 2);
  EXPECT_EQ(run("01_make_a_map " + dir.path() + "/absent/a.apgm").code, 5);
  EXPECT_EQ(run("02_fuse_two_maps a b c d").code, 2);
  EXPECT_EQ(run("02_fuse_two_maps " + (dir / "a") + " " + (dir / "b") + " 0 0").code, 4);
  EXPECT_EQ(run("03_stream_a_file " + (dir / "a")).code, 4);
  test::write_file(dir / "text", "not a map");
  EXPECT_EQ(run("03_stream_a_file " + (dir / "text")).code, 4);
}

TEST(MakeSceneTest, WritesReadableMapsAndKeepsThem) {
  const test::TempDir dir;
  const Outcome made = run("make-scene -o " + (dir / "maps"));
  ASSERT_EQ(made.code, 0) << made.output;
  EXPECT_EQ(made.output, "");
  const Reader a(dir / "maps/vehicle_a.apgm");
  const Reader b(dir / "maps/vehicle_b.apgm");
  const Reader truth(dir / "maps/truth.apgm");
  EXPECT_EQ(a.header().frame, b.header().frame);
  EXPECT_EQ(a.header().frame, truth.header().frame);
  EXPECT_EQ(a.header().types.size(), 2u);
  EXPECT_TRUE(a.summary().range.meets(b.summary().range));
  EXPECT_LT(a.summary().range.min.x, 0);
  EXPECT_EQ(Reader(dir / "maps/scan_a_front.apgm").header().types[0].policy, Policy::kExclusive);
  EXPECT_NE(Reader(dir / "maps/lidar_b_rear.apgm").content_id(),
            Reader(dir / "maps/lidar_b_front.apgm").content_id());

  const Outcome again = run("make-scene -o " + (dir / "maps"));
  EXPECT_EQ(again.code, 5);
  EXPECT_THAT(again.output, HasSubstr("already exists"));
}

TEST(MakeSceneTest, RefusesBadArguments) {
  const test::TempDir dir;
  EXPECT_EQ(run("make-scene").code, 2);
  EXPECT_EQ(run("make-scene -o").code, 2);
  EXPECT_EQ(run("make-scene --fast -o " + (dir / "maps")).code, 2);
  EXPECT_EQ(run("make-scene --seed -1 -o " + (dir / "maps")).code, 2);
  test::write_file(dir / "file", "");
  EXPECT_EQ(run("make-scene -o " + (dir / "file")).code, 5);
  EXPECT_EQ(run("make-scene --help").code, 0);
  EXPECT_THAT(dir.list(), testing::ElementsAre("file"));
}

}  // namespace
}  // namespace apgm
