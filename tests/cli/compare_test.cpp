#include <algorithm>
#include <cmath>
#include <sstream>

#include "apgm/fuse/resample.hpp"
#include "cli_test.hpp"

namespace apgm::test {
namespace {

class CompareCliTest : public CliTest {
 protected:
  Outcome compare(const std::vector<std::string>& arguments) const { return tool("compare", arguments); }
  Json document(std::vector<std::string> arguments) const {
    arguments.push_back("--json");
    const Outcome outcome = compare(arguments);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_EQ(outcome.err, "");
    return Json::parse(outcome.out, nullptr, false);
  }
  static Json layout(const Json& list, const std::string& name) {
    for (const Json& one : list) {
      if (one["layout"] == name) return one;
    }
    ADD_FAILURE() << "no layout " << name;
    return {};
  }

  /// Occupancy and the paper's semantics, which makes cells of 6 values; patches (-n, -n) to (n - 1, n - 1).
  Map paper_map(int n, int step) const {
    MapHeader header;
    header.types =
        TypeTable({LayerType::occupancy(), LayerType::semantic("semantics", {"Road", "Marking", "Blocked"})});
    Map map(header);
    for (int y = -n; y < n; ++y) {
      for (int x = -n; x < n; ++x) {
        Layer& layer = map.layer({x, y}, 0, step);
        std::ranges::fill(layer.plane(1), 0.5f);
        // Single occupied cells: what coarser cells change most.
        for (int i = 0; i < layer.side(); i += 8) {
          layer.at(0, {i, i}) = 0.75f;
          layer.at(1, {i, i}) = 0;
        }
      }
    }
    return map;
  }

  /// A vehicle that drives along x in a square room.
  static std::string log(int scans) {
    std::ostringstream text;
    for (int i = 0; i < scans; ++i) {
      text << "FLASER 61";
      for (int beam = 0; beam <= 60; ++beam) text << ' ' << 6 + beam % 5;
      text << ' ' << 0.05 * i << " 0 0 " << 0.05 * i << " 0 0 " << 100 + 0.1 * i << " host " << 0.1 * i
           << '\n';
    }
    return text.str();
  }
  static constexpr const char* kProfiles =
      "profiles:\n"
      "  - name: parking\n"
      "    from_s: 0\n"
      "    requirements:\n"
      "      - {layer: occupancy, horizon_m: 20, cell_m: 0.1}\n"
      "  - name: road\n"
      "    from_s: 2\n"
      "    requirements:\n"
      "      - {layer: occupancy, horizon_m: 40, cell_m: 0.2}\n";

  std::vector<std::string> lines(const std::string& name) const {
    std::vector<std::string> all;
    std::istringstream in(bytes(name));
    for (std::string line; std::getline(in, line);) all.push_back(line);
    return all;
  }
};

TEST_F(CompareCliTest, CountsAreThoseOfTheLayouts) {
  write("a.apgm", paper_map(2, 6));
  const Json all = document({"a.apgm", "--at", "0,0"})["layouts"];
  const Json own = layout(all, "apgm");
  EXPECT_EQ(own["cells"], 16 * 4096);
  EXPECT_EQ(own["values"], 16 * 4096 * 2);
  EXPECT_EQ(own["fill"], 1);
  EXPECT_EQ(own["values_ratio"], 1);
  for (const char* name : {"buerkle-A", "buerkle-B", "buerkle-C"}) {
    const Json buerkle = layout(all, name);
    EXPECT_EQ(buerkle["cells"], 640'000);
    EXPECT_EQ(buerkle["values_per_cell"], 6);
    EXPECT_EQ(buerkle["values_bytes"], 640'000 * 24);
    EXPECT_DOUBLE_EQ(buerkle["values_ratio"].get<double>(), 640'000.0 * 6 / (16 * 4096 * 2));
  }
  EXPECT_EQ(layout(all, "moving")["cells"], 1'000'000);
  for (const char* name : {"dense_array", "hash_map", "quadtree", "sorted_vector", "cow_tiles"}) {
    const Json submaps = layout(all, std::string("submaps-") + name);
    EXPECT_EQ(submaps["cells"], 16 * 4096);
    EXPECT_EQ(submaps["values_ratio"], 3);
    EXPECT_GT(submaps["allocated_bytes"], submaps["values_bytes"]);
    EXPECT_EQ(submaps["belief"]["max_change"], 0);
    EXPECT_EQ(submaps["belief"]["lost_cells"], 0);
  }
}

TEST_F(CompareCliTest, NothingIsLostWithinTheFinestCells) {
  // 25.6 m to each side: the corners of the map lie where A's cells are 0.2 m, as are the map's.
  write("a.apgm", paper_map(2, 6));
  const Json belief = layout(document({"a.apgm", "--at", "0,0"})["layouts"], "buerkle-A")["belief"];
  EXPECT_EQ(belief["lost_cells"], 0);
  EXPECT_EQ(belief["lost_obstacles"], 0);
  EXPECT_LT(belief["max_change"], 2e-6);
}

TEST_F(CompareCliTest, ChangeIsThatOfMergingAndSplittingAgain) {
  // All of the map lies where A's cells are 0.4 m: 2 x 2 cells of 0.2 m become one and four again.
  const Map map = paper_map(1, 6);
  write("a.apgm", map);
  const Json belief = layout(document({"a.apgm", "--at", "80,0"})["layouts"], "buerkle-A")["belief"];
  const Layer& native = *map.find({0, 0}, 0);
  Layer merged, back;
  resample(native, map.header().types[0], 5, merged);
  resample(merged, map.header().types[0], 6, back);
  double most = 0, sum = 0;
  const auto bet = [](const Layer& layer, std::size_t i) {
    return (1 + static_cast<double>(layer.plane(0)[i]) - static_cast<double>(layer.plane(1)[i])) / 2;
  };
  for (std::size_t i = 0; i < native.cells(); ++i) {
    const double change = std::fabs(bet(native, i) - bet(back, i));
    most = std::max(most, change);
    sum += change;
  }
  ASSERT_GT(most, 0.1);
  EXPECT_NEAR(belief["max_change"].get<double>(), most, 1e-6);
  EXPECT_NEAR(belief["mean_change"].get<double>(), sum / static_cast<double>(native.cells()), 1e-6);
  EXPECT_EQ(belief["lost_cells"], 0);
}

TEST_F(CompareCliTest, CellsOutsideALayoutAreLost) {
  write("a.apgm", paper_map(1, 5));
  const Json all = document({"a.apgm", "--at", "500,500"})["layouts"];
  EXPECT_EQ(layout(all, "buerkle-A")["belief"]["lost_cells"], 4 * 1024);
  EXPECT_EQ(layout(all, "moving")["belief"]["lost_cells"], 4 * 1024);
  EXPECT_EQ(layout(all, "submaps-quadtree")["belief"]["lost_cells"], 0);
}

TEST_F(CompareCliTest, BytesOnDiskAreThoseOfTheFiles) {
  write("a.apgm", paper_map(1, 6));
  const Json all = document({"a.apgm", "--at", "0,0"})["layouts"];
  EXPECT_EQ(layout(all, "apgm")["disk_bytes"], bytes("a.apgm").size());
  for (const Json& one : all) EXPECT_GT(one["disk_bytes"], 0) << one["layout"];
}

TEST_F(CompareCliTest, AnotherLayoutFromYaml) {
  write("a.apgm", paper_map(1, 6));
  put("plan.yaml", "name: corridor\nrectangles:\n  - {x_m: [-20, 20], y_m: [-4, 4], cell_m: 0.2}\n");
  EXPECT_EQ(layout(document({"a.apgm", "--layout", "plan.yaml"})["layouts"], "buerkle-corridor")["cells"],
            200 * 40);
  put("gap.yaml",
      "name: gap\nrectangles:\n  - {x_m: [0, 4], y_m: [0, 4], cell_m: 0.2}\n"
      "  - {x_m: [6, 8], y_m: [0, 4], cell_m: 0.2}\n");
  expect_failure(compare({"a.apgm", "--layout", "gap.yaml"}), 2, "gap");
  expect_failure(compare({"a.apgm", "--layout", "none.yaml"}), 4, "none.yaml");
}

TEST_F(CompareCliTest, TablesNameEveryLayout) {
  write("a.apgm", paper_map(1, 6));
  const Outcome plain = compare({"a.apgm"});
  EXPECT_EQ(plain.code, 0);
  EXPECT_EQ(plain.err, "");
  for (const char* word :
       {"apgm", "buerkle-A", "buerkle-C", "moving", "submaps-hash_map", "on disk", "cells lost"}) {
    EXPECT_THAT(plain.out, HasSubstr(word));
  }
  EXPECT_EQ(plain.out.find("snapshot"), std::string::npos);
  EXPECT_EQ(compare({"a.apgm"}).out, plain.out);
  const Json cost = layout(document({"a.apgm", "--cost"})["layouts"], "apgm")["cost"];
  EXPECT_GT(cost["find_ns"], 0);
  EXPECT_GT(cost["iterate_ns"], 0);
}

TEST_F(CompareCliTest, WritesTableAndPicture) {
  write("a.apgm", paper_map(1, 6));
  EXPECT_EQ(compare({"a.apgm", "--csv", "a.csv", "--plot", "a.svg"}).code, 0);
  const auto table = lines("a.csv");
  ASSERT_EQ(table.size(), 11u);
  EXPECT_TRUE(table[0].starts_with("time_s,profile,x_m,y_m,layout,"));
  const auto commas = std::ranges::count(table[0], ',');
  for (const std::string& line : table) EXPECT_EQ(std::ranges::count(line, ','), commas) << line;
  EXPECT_TRUE(bytes("a.svg").starts_with("<svg "));
  EXPECT_THAT(bytes("a.svg"), HasSubstr("buerkle-B"));
  expect_failure(compare({"a.apgm", "--csv", "a.csv"}), 5, "output 'a.csv' already exists");
  EXPECT_EQ(compare({"a.apgm", "--csv", "a.csv", "-O"}).code, 0);
}

TEST_F(CompareCliTest, ADriveHasARowForEachMomentAndLayout) {
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
  EXPECT_EQ(lines("run.csv").size(), 1 + 5 * 10u);
  // 0.1 m throughout: on the road the map needs a quarter of the cells of sub-maps, and a third of their
  // values.
  EXPECT_EQ(layout(parking["layouts"], "submaps-hash_map")["values_ratio"], 3);
  EXPECT_EQ(layout(all["phases"][1]["layouts"], "submaps-hash_map")["values_ratio"], 12);
  EXPECT_EQ(layout(parking["layouts"], "moving")["cells"], 640'000);
  EXPECT_THAT(bytes("run.svg"), HasSubstr("road"));
}

TEST_F(CompareCliTest, MotionTakesAllAsSeen) {
  // The vehicle stands in the middle of patch (0, 0): the disc of 20 m meets the 13 patches it should.
  put("poses.txt", "0 6.4 6.4 0 0 0 0 1\n1 6.4 6.4 0 0 0 0 1\n2.5 6.4 6.4 0 0 0 0 1\n");
  put("drive.yaml", kProfiles);
  const Json all = document({"poses.txt", "--motion", "--profile", "drive.yaml", "--every", "0"});
  ASSERT_EQ(all["phases"].size(), 2u);
  const Json own = layout(all["phases"][0]["layouts"], "apgm");
  EXPECT_EQ(own["cells"], 13 * 16384);
  EXPECT_EQ(own["fill"], 1);
}

TEST_F(CompareCliTest, RefusesWhatDoesNotFitTogether) {
  write("a.apgm", paper_map(1, 5));
  put("drive.yaml", kProfiles);
  put("run.log", log(3));
  expect_failure(compare({"a.apgm", "--every", "1"}), 2, "--every is for drives", "--profile");
  expect_failure(compare({"a.apgm", "--motion"}), 2, "--motion is for drives");
  expect_failure(compare({"run.log", "--profile", "drive.yaml", "--at", "0,0"}), 2, "--at is for maps");
  expect_failure(compare({"a.apgm", "a.apgm"}), 2, "");
  expect_failure(compare({"a.apgm", "--csv", "-"}), 2, "--csv is not written to standard output");
  expect_failure(compare({"a.apgm", "--csv", "b", "--plot", "b"}), 2, "--csv and --plot name one file");
  expect_failure(compare({"a.apgm", "--csv", "a.apgm", "-O"}), 2, "a.apgm");
  expect_failure(compare({"a.apgm", "--at", "1"}), 2, "--at");
  expect_failure(compare({"a.apgm", "--reach", "0"}), 2, "--reach");
  expect_failure(compare({"a.apgm", "--profile", "drive.yaml"}), 4, "a.apgm");
  EXPECT_EQ(files(), (std::set<std::string>{"a.apgm", "drive.yaml", "run.log"}));
}

TEST_F(CompareCliTest, AnEmptyMapHasNothingToCompare) {
  write("a.apgm", empty_map());
  expect_failure(compare({"a.apgm"}), 2, "'a.apgm' holds no patches to compare");
}

}  // namespace
}  // namespace apgm::test
