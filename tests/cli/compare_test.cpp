#include <cmath>

#include "apgm/format/reader.hpp"
#include "apgm/fuse/resample.hpp"
#include "compare_test.hpp"

namespace apgm::test {
namespace {

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
  for (const Json& one : all) {
    if (one.contains("note")) continue;
    EXPECT_GT(one["disk_bytes"], 0) << one["layout"];
  }
}

TEST_F(CompareCliTest, ForeignFormatsAreWrittenAndReadBack) {
  write("a.apgm", paper_map(1, 6));
  const Json all = document({"a.apgm", "--at", "0,0"})["layouts"];
  // Cells have either mass, so that BetP tells them; a .bt keeps two values of it.
  for (const char* name : {"octomap-ot", "geotiff", "numpy"}) {
    const Json one = layout(all, name);
    if (one.contains("note")) continue;  // not in this build
    EXPECT_EQ(one["belief"]["lost_cells"], 0) << name;
    EXPECT_LT(one["belief"]["max_change"], 1e-6) << name;
    EXPECT_EQ(one.contains("cells"), name == std::string("octomap-ot"));
  }
  const Json ot = layout(all, "octomap-ot"), bt = layout(all, "octomap-bt");
  if (!ot.contains("note")) {
    EXPECT_EQ(tool("convert", {"a.apgm", "-q", "-o", "a.ot"}).code, 0);
    EXPECT_EQ(ot["disk_bytes"], bytes("a.ot").size());
    EXPECT_EQ(tool("convert", {"a.apgm", "-q", "-o", "a.bt"}).code, 3);
    EXPECT_EQ(bt["disk_bytes"], bytes("a.bt").size());
    EXPECT_GT(bt["belief"]["max_change"], 0.1);
    // Voxels of one height have no eight brothers to be pruned with.
    EXPECT_EQ(ot["cells"], 4 * 4096);
    EXPECT_GT(ot["allocated_bytes"], ot["values_bytes"]);
  }
  const Json tif = layout(all, "geotiff");
  if (!tif.contains("note")) {
    EXPECT_EQ(tool("convert", {"a.apgm", "-q", "--layer", "occupancy", "-o", "a.tif"}).code, 0);
    EXPECT_EQ(tif["disk_bytes"], bytes("a.tif").size());
  }
}

TEST_F(CompareCliTest, AMapThatAFormatCannotHoldIsTold) {
  MapHeader header;
  header.types = TypeTable({LayerType::real("height", {"z"})});
  Map map(header);
  map.layer({0, 0}, 0, 3).at(0, {1, 1}) = 2;
  write("a.apgm", map);
  const Outcome plain = compare({"a.apgm"});
  EXPECT_EQ(plain.code, 0) << plain.err;
  EXPECT_THAT(plain.out, HasSubstr("octomap-bt: "));
  // Two patches at either end of the plane: no array holds what lies between them.
  Map wide = paper_map(0, 3);
  for (const std::int32_t x : {-40'000'000, 40'000'000}) wide.layer({x, x}, 0, 3).at(0, {0, 0}) = 0.5f;
  write("wide.apgm", wide);
  const Json all = document({"wide.apgm"})["layouts"];
  EXPECT_THAT(layout(all, "numpy")["note"].get<std::string>(), HasSubstr("whole extent"));
  EXPECT_FALSE(layout(all, "numpy").contains("disk_bytes"));
  EXPECT_FALSE(layout(all, "submaps-dense_array")["note"].empty());
  EXPECT_EQ(layout(all, "submaps-quadtree")["belief"]["lost_cells"], 0);
  EXPECT_EQ(files(), (std::set<std::string>{"a.apgm", "wide.apgm"}));
}

TEST_F(CompareCliTest, TemporaryFilesAreGone) {
  write("a.apgm", paper_map(1, 5));
  std::filesystem::create_directory(path("scratch"));
  Launch launch;
  launch.environment = {"TMPDIR=" + path("scratch")};
  EXPECT_EQ(tool("compare", {"a.apgm"}, launch).code, 0);
  EXPECT_TRUE(std::filesystem::is_empty(path("scratch")));
  launch.environment = {"TMPDIR=" + path("nowhere")};
  expect_failure(tool("compare", {"a.apgm"}, launch), 5, "temporary directory", "TMPDIR");
}

TEST_F(CompareCliTest, AFileOfALayoutLosesWhatIsSaid) {
  // Some cells are lost, some within 20 m, some merged twice.
  RandomMapOptions options;
  options.types = {LayerType::occupancy()};
  options.range = {{-9, -9}, {8, 8}};
  options.min_step = options.max_step = 7;
  options.fill = 0.25;
  const Map map = random_map(11, options);
  write("a.apgm", map);
  EXPECT_EQ(
      tool("convert", {"a.apgm", "-q", "--set", "layout=A", "--set", "vehicle=3,-20", "-o", "a.apfg"}).code,
      3);
  EXPECT_EQ(tool("convert", {"a.apfg", "-q", "-o", "back.apgm"}).code, 0);
  const Reader reader(path("back.apgm"));
  Map back(reader.header());
  MapSink sink(back);
  copy(reader, reader.header().types, sink, true);
  const TypeTable& types = map.header().types;
  std::uint64_t known = 0, lost = 0, near = 0;
  double sum = 0, most = 0;
  Layer at_own_step;
  for (const auto& [key, patch] : map.by_key()) {
    const Layer& layer = patch.layers.begin()->second;
    const Layer* found = back.find(patch.index, *back.header().types.find("occupancy"));
    if (found != nullptr) resample(*found, types[0], layer.step(), at_own_step);
    for (std::size_t i = 0; i < layer.cells(); ++i) {
      const auto mass = [&](const Layer& of, int c) { return static_cast<double>(of.plane(c)[i]); };
      if (mass(layer, 0) + mass(layer, 1) == 0) continue;
      ++known;
      if (found == nullptr || mass(at_own_step, 0) + mass(at_own_step, 1) == 0) {
        ++lost;
        continue;
      }
      const double change =
          std::fabs(mass(layer, 0) - mass(layer, 1) - mass(at_own_step, 0) + mass(at_own_step, 1)) / 2;
      const Box box = map.header().frame.box_m(patch.index);
      const double x = box.min.x_m + 0.1 * (static_cast<double>(i % 128) + 0.5) - 3;
      const double y = box.min.y_m + 0.1 * (static_cast<double>(i / 128) + 0.5) + 20;
      if (std::max(std::fabs(x), std::fabs(y)) < 19.8) {
        ++near;
        ASSERT_EQ(change, 0);
      }
      sum += change;
      most = std::max(most, change);
    }
  }
  EXPECT_GT(near, 1000u);
  EXPECT_GT(lost, 1000u);
  EXPECT_GT(most, 0.1);
  const Json belief = layout(document({"a.apgm", "--at", "3,-20"})["layouts"], "buerkle-A")["belief"];
  EXPECT_EQ(belief["known_cells"], known);
  EXPECT_EQ(belief["lost_cells"], lost);
  EXPECT_NEAR(belief["mean_change"].get<double>(), sum / static_cast<double>(known - lost), 1e-9);
  EXPECT_NEAR(belief["max_change"].get<double>(), most, 1e-9);
}

TEST_F(CompareCliTest, MemoryIsBoundedBeforeItIsTaken) {
  write("a.apgm", paper_map(1, 6));
  expect_failure(compare({"a.apgm", "--max-memory", "60M"}), 6, "does not hold the layouts", "at least");
  expect_failure(compare({"a.apgm", "--max-memory", "1M"}), 6, "");
  const std::string plain = compare({"a.apgm"}).out;
  EXPECT_EQ(compare({"a.apgm", "--max-memory", "1G", "-j", "1", "--no-progress"}).out, plain);
  expect_failure(compare({"a.apgm", "-j", "x"}), 2, "--threads");
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
  ASSERT_EQ(table.size(), 1 + 14u);
  EXPECT_TRUE(table[0].starts_with("time_s,profile,x_m,y_m,layout,"));
  const auto commas = std::ranges::count(table[0], ',');
  for (const std::string& line : table) EXPECT_EQ(std::ranges::count(line, ','), commas) << line;
  EXPECT_TRUE(bytes("a.svg").starts_with("<svg "));
  EXPECT_THAT(bytes("a.svg"), HasSubstr("buerkle-B"));
  expect_failure(compare({"a.apgm", "--csv", "a.csv"}), 5, "output 'a.csv' already exists");
  EXPECT_EQ(compare({"a.apgm", "--csv", "a.csv", "-O"}).code, 0);
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
  expect_failure(compare({"a.apgm"}), 7, "'a.apgm' holds no patches to compare", "apgm-info");
}

}  // namespace
}  // namespace apgm::test
