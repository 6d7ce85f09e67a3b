#include "compare_test.hpp"

namespace apgm::test {
namespace {

using CompareDriveCliTest = CompareCliTest;

TEST_F(CompareDriveCliTest, ADriveHasARowForEachMomentAndLayout) {
  put("run.log", log(41));
  put("drive.yaml", kProfiles);
  const Json all = document(
      {"run.log", "--profile", "drive.yaml", "--every", "1", "--csv", "run.csv", "--plot", "run.svg"});
  ASSERT_EQ(all["phases"].size(), 2u);
  EXPECT_EQ(all["measurements"], 41);
  const Json& parking = all["phases"][0];
  EXPECT_EQ(parking["profile"], "parking");
  EXPECT_EQ(parking["moments"], 2);
  EXPECT_EQ(all["phases"][1]["moments"], 3);
  EXPECT_EQ(lines("run.csv").size(), 1 + 5 * 14u);
  // 0.1 m throughout: on the road the map needs a quarter of the cells of sub-maps, and a third of their
  // values.
  EXPECT_EQ(layout(parking["layouts"], "submaps-hash_map")["values_ratio"], 3);
  EXPECT_EQ(layout(all["phases"][1]["layouts"], "submaps-hash_map")["values_ratio"], 12);
  EXPECT_EQ(layout(parking["layouts"], "moving")["cells"], 640'000);
  EXPECT_THAT(bytes("run.svg"), HasSubstr("road"));
}

TEST_F(CompareDriveCliTest, MotionTakesAllAsSeen) {
  // The vehicle stands in the middle of patch (0, 0): the disc of 20 m meets the 13 patches it should.
  put("poses.txt", "0 6.4 6.4 0 0 0 0 1\n1 6.4 6.4 0 0 0 0 1\n2.5 6.4 6.4 0 0 0 0 1\n");
  put("drive.yaml", kProfiles);
  const Json all = document({"poses.txt", "--motion", "--profile", "drive.yaml", "--every", "0"});
  ASSERT_EQ(all["phases"].size(), 2u);
  const Json own = layout(all["phases"][0]["layouts"], "apgm");
  EXPECT_EQ(own["cells"], 13 * 16384);
  EXPECT_EQ(own["fill"], 1);
  // Cells that are all alike say nothing of files and beliefs.
  for (const Json& one : all["phases"][0]["layouts"]) {
    EXPECT_FALSE(one.contains("disk_bytes"));
    EXPECT_FALSE(one.contains("belief"));
  }
  const Outcome plain = compare({"poses.txt", "--motion", "--profile", "drive.yaml"});
  EXPECT_EQ(plain.out.find("cells lost"), std::string::npos);
  EXPECT_THAT(plain.out, testing::ContainsRegex("apgm .* -  *-\n"));
}

TEST_F(CompareDriveCliTest, LayoutsTravelInSnappedSteps) {
  put("run.log", log(41));
  put("drive.yaml", kProfiles);
  const std::vector<std::string> drive{"run.log", "--profile", "drive.yaml", "--every", "1"};
  const auto shifts = [&](const Json& all, const char* name) {
    std::uint64_t sum = 0;
    for (const Json& phase : all["phases"])
      sum += layout(phase["layouts"], name)["shifts"].get<std::uint64_t>();
    return sum;
  };
  // 2 m: cells of 0.1 m are passed 20 times, the coarsest of the non-uniform grids 5 times.
  const Json all = document(drive);
  EXPECT_EQ(shifts(all, "moving"), 20u);
  for (const char* name : {"buerkle-A", "buerkle-B", "buerkle-C"}) EXPECT_EQ(shifts(all, name), 5u);
  EXPECT_EQ(shifts(all, "submaps-hash_map"), 0u);
  // All of the map lies in the moving grid, with the same cells.
  for (const Json& phase : all["phases"]) {
    EXPECT_EQ(layout(phase["layouts"], "moving")["belief"]["lost_cells"], 0);
    EXPECT_LT(layout(phase["layouts"], "moving")["belief"]["max_change"], 2e-6);
  }
  auto timed = drive;
  timed.insert(timed.end(), {"--cost", "--plot", "run.svg", "--csv", "run.csv"});
  EXPECT_GT(layout(document(timed)["phases"][1]["layouts"], "moving")["cost"]["shift_ns"], 0);
  EXPECT_THAT(bytes("run.svg"), HasSubstr("shift [ms]"));
  EXPECT_TRUE(lines("run.csv")[0].ends_with(",shifts,note"));
}

}  // namespace
}  // namespace apgm::test
