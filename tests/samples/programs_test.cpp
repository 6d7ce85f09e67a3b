#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <sstream>
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

Outcome shell(const std::string& command) {
  Outcome outcome;
  FILE* pipe = ::popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return outcome;
  std::array<char, 4096> buffer{};
  while (const std::size_t n = std::fread(buffer.data(), 1, buffer.size(), pipe))
    outcome.output.append(buffer.data(), n);
  const int status = ::pclose(pipe);
  if (WIFEXITED(status)) outcome.code = WEXITSTATUS(status);
  return outcome;
}

Outcome run(const std::string& program) { return shell(std::string(APGM_SAMPLES_DIR) + "/" + program); }

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

TEST(SampleProgramsTest, CopyOfALiveMapStaysEqual) {
  const test::TempDir dir;
  const Outcome live = run("04_map_live " + (dir / "near.apgm"));
  EXPECT_EQ(live.code, 0) << live.output;
  EXPECT_THAT(live.output, HasSubstr("the copy is equal"));
  const Reader near(dir / "near.apgm");
  EXPECT_GE(near.summary().patches, 2u);
  EXPECT_LE(near.summary().patches, 9u);
  EXPECT_EQ(run("04_map_live").code, 2);
  EXPECT_EQ(run("04_map_live " + (dir / "near.apgm")).code, 5);  // exists
}

TEST(SampleProgramsTest, TheMapOfSensorModulesIsTheOneFusedInOneProcess) {
  const test::TempDir dir;
  const Outcome linked = run("05_sensor_link " + (dir / "hall.apgm") + " 5000000");
  EXPECT_EQ(linked.code, 0) << linked.output;
  EXPECT_THAT(linked.output, HasSubstr("layers in 12 messages"));
  EXPECT_THAT(linked.output, HasSubstr("equal to the map fused in one process"));
  EXPECT_GT(Reader(dir / "hall.apgm").summary().patches, 2u);
  EXPECT_EQ(run("05_sensor_link").code, 2);
  EXPECT_EQ(run("05_sensor_link " + (dir / "other.apgm") + " 0").code, 2);
  EXPECT_EQ(run("05_sensor_link " + (dir / "hall.apgm") + " 5000000").code, 5);  // exists
}

TEST(DriveMapTest, WritesStatisticsAndTheLiveMap) {
  const test::TempDir dir;
  const std::string command = "drive-map --from 155.5 --seconds 1 --stats " + (dir / "a.csv");
  const Outcome drive = run(command + " -o " + (dir / "a.apgm"));
  ASSERT_EQ(drive.code, 0) << drive.output;
  EXPECT_THAT(drive.output, HasSubstr("parking      155.5-155.9"));
  EXPECT_THAT(drive.output, HasSubstr("road         156.0-156.4"));

  std::istringstream stats(test::read_file(dir / "a.csv"));
  std::string line;
  std::getline(stats, line);
  EXPECT_EQ(line,
            "time_s,profile,x_m,y_m,patches,"
            "occupancy_cells,occupancy_bytes,occupancy_fill,occupancy_observe_ms,occupancy_fuse_ms,occupancy_"
            "upkeep_ms,"
            "semantics_cells,semantics_bytes,semantics_fill,semantics_observe_ms,semantics_fuse_ms,semantics_"
            "upkeep_ms");
  int lines = 0;
  while (std::getline(stats, line)) {
    EXPECT_EQ(std::count(line.begin(), line.end(), ','), 16) << line;
    EXPECT_THAT(line, HasSubstr(lines < 5 ? ",parking," : ",road,"));
    ++lines;
  }
  EXPECT_EQ(lines, 10);

  // The same seed gives the same file, another one another.
  EXPECT_EQ(run("drive-map --from 155.5 --seconds 1 -o " + (dir / "b.apgm")).code, 0);
  EXPECT_EQ(test::read_file(dir / "a.apgm"), test::read_file(dir / "b.apgm"));
  EXPECT_EQ(run("drive-map --seed 2 --from 155.5 --seconds 1 -O -o " + (dir / "b.apgm")).code, 0);
  EXPECT_NE(test::read_file(dir / "a.apgm"), test::read_file(dir / "b.apgm"));
}

TEST(DriveMapTest, StatisticsCanBeDrawn) {
  const test::TempDir dir;
  const std::string plot = std::string("python3 ") + APGM_SAMPLES_SOURCE_DIR + "/plot_drive.py ";
  ASSERT_EQ(run("drive-map --from 155 --seconds 2 --stats " + (dir / "a.csv")).code, 0);
  const Outcome drawn = shell(plot + (dir / "a.csv") + " " + (dir / "a.svg"));
  ASSERT_EQ(drawn.code, 0) << drawn.output;
  const std::string svg = test::read_file(dir / "a.svg");
  EXPECT_EQ(svg.rfind("<svg", 0), 0u);
  for (const char* words : {">parking<", ">road<", ">occupancy<", ">semantics<"}) {
    EXPECT_THAT(svg, HasSubstr(words));
  }
  test::write_file(dir / "b.csv", "a,b\n1,2\n");
  EXPECT_NE(shell(plot + (dir / "b.csv") + " " + (dir / "b.svg")).code, 0);
}

TEST(DriveMapTest, RefusesBadArguments) {
  const test::TempDir dir;
  EXPECT_EQ(run("drive-map --seconds fast").code, 2);
  EXPECT_EQ(run("drive-map --seed 1.5").code, 2);
  EXPECT_EQ(run("drive-map surplus").code, 2);
  EXPECT_EQ(run("drive-map --profiles " + (dir / "absent.yaml")).code, 4);
  test::write_file(dir / "bad.yaml", "requirements:\n  - {layer: occupancy, horizon_m: 20, cell_m: 0.15}\n");
  const Outcome bad = run("drive-map --seconds 1 --profiles " + (dir / "bad.yaml"));
  EXPECT_EQ(bad.code, 2);
  EXPECT_THAT(bad.output, HasSubstr("power-of-two"));
  // Refused before the drive, not when its time comes.
  test::write_file(dir / "late.yaml",
                   "profiles:\n"
                   "  - {from_s: 0, requirements: [{layer: occupancy, horizon_m: 20, cell_m: 0.1}]}\n"
                   "  - {from_s: 400, requirements: [{layer: radar, horizon_m: 20, cell_m: 0.1}]}\n");
  EXPECT_EQ(run("drive-map --seconds 0.1 --profiles " + (dir / "late.yaml")).code, 2);
  test::write_file(dir / "kept", "");
  EXPECT_EQ(run("drive-map --seconds 1 -o " + (dir / "kept")).code, 5);
  EXPECT_EQ(run("drive-map --seconds 1 --stats " + (dir / "kept")).code, 5);
  EXPECT_EQ(run("drive-map --help").code, 0);
  EXPECT_THAT(dir.list(), testing::UnorderedElementsAre("bad.yaml", "kept", "late.yaml"));
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
