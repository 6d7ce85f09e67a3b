#include "cli_test.hpp"

namespace apgm::test {
namespace {

class DiffCliTest : public CliTest {
 protected:
  Outcome diff(std::vector<std::string> arguments) const { return tool("diff", arguments); }
  Json diff_json(std::vector<std::string> arguments, int code) const {
    arguments.emplace_back("--json");
    const Outcome outcome = diff(arguments);
    EXPECT_EQ(outcome.code, code) << outcome.err;
    EXPECT_EQ(outcome.err, "");
    return Json::parse(outcome.out, nullptr, false);
  }
  /// plain_map(2, 1), and the same with one cell of patch (1, 0) occupied and one forgotten.
  void write_pair() const {
    Map map = plain_map(2, 1);
    write("a.apgm", map);
    Layer& layer = map.layer({1, 0}, 0, 3);
    layer.at(0, {0, 2}) = 0.75f;
    layer.at(1, {0, 2}) = 0.0f;
    layer.at(0, {1, 3}) = 0.0f;
    layer.at(1, {1, 3}) = 0.0f;
    write("b.apgm", map);
  }
};

TEST_F(DiffCliTest, EqualMapsEndWithZero) {
  write_random("a.apgm", 1);
  WriterOptions tight;
  tight.level = 19;
  write("b.apgm", random_map(1), tight);
  for (const char* level : {"bytes", "cells", "belief"}) {
    const Outcome outcome = diff({"--level", level, "a.apgm", "b.apgm"});
    EXPECT_EQ(outcome.code, 0) << level;
    EXPECT_EQ(outcome.err, "");
    EXPECT_THAT(outcome.out, HasSubstr("a.apgm -> b.apgm: equal (level " + std::string(level)));
    EXPECT_THAT(outcome.out, HasSubstr("0 added, 0 removed, 0 changed, "));
  }
}

TEST_F(DiffCliTest, DifferentMapsEndWithOneAndSilence) {
  write_pair();
  const Outcome outcome = diff({"a.apgm", "b.apgm", "--top", "3"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_EQ(outcome.err, "");
  EXPECT_THAT(outcome.out, HasSubstr("a.apgm -> b.apgm: different (level cells)\n"));
  EXPECT_THAT(outcome.out, HasSubstr("0 added, 0 removed, 1 changed, 1 equal\n"));
  EXPECT_THAT(outcome.out, HasSubstr("free -> occupied              1 cell, 2.56 m2\n"));
  EXPECT_THAT(outcome.out, HasSubstr("forgotten (known -> unknown)  1 cell, 2.56 m2\n"));
  EXPECT_THAT(outcome.out, HasSubstr("1 of 1 region that changed, most area first\n"));
  EXPECT_THAT(outcome.out, HasSubstr("5.12 m2  12.8,3.2,16,6.4\n"));
}

TEST_F(DiffCliTest, ABoxOutsideOfBothMapsGivesAWarning) {
  write_pair();
  const Outcome outcome = diff({"a.apgm", "b.apgm", "--bbox", "5000,5000,5001,5001"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("warning: nothing of 'a.apgm' and 'b.apgm' lies in --bbox"));
}

TEST_F(DiffCliTest, DocumentHasEveryFigure) {
  write_pair();
  const Json doc = diff_json({"a.apgm", "b.apgm", "--top", "2"}, 1);
  EXPECT_EQ(doc["schema"], "apgm.diff/1");
  EXPECT_EQ(doc["equal"], false);
  EXPECT_EQ(doc["level"], "cells");
  EXPECT_EQ(doc["tolerance"], Json());
  EXPECT_EQ(doc["png"], Json());
  EXPECT_EQ(doc["reference"]["content_id"], info("a.apgm")["map"]["content_id"]);
  EXPECT_EQ(doc["patches"], (Json{{"added", 0}, {"removed", 0}, {"changed", 1}, {"equal", 1}}));
  const Json layer = doc["layers"][0];
  EXPECT_EQ(layer["name"], "occupancy");
  EXPECT_EQ(layer["compared"]["cells"], 64);
  EXPECT_EQ(layer["changed"]["cells"], 2);
  EXPECT_EQ(layer["free_to_occupied"]["cells"], 1);
  EXPECT_EQ(layer["occupied_to_free"]["cells"], 0);
  EXPECT_EQ(layer["forgotten"]["cells"], 1);
  EXPECT_EQ(layer["betp_delta"]["max"], 0.5);
  EXPECT_EQ(layer["mass_delta_max"], 0.5);
  EXPECT_EQ(layer["conflict"]["max"], 0.375);
  EXPECT_GT(layer["kl_divergence_nat"], 0);
  EXPECT_GT(layer["jousselme"]["mean"], 0);
  EXPECT_EQ(doc["regions"].size(), 1u);
  EXPECT_EQ(doc["regions"][0]["bbox_m"], Json({12.8, 3.2, 16.0, 6.4}));
  EXPECT_FALSE(doc.contains("error"));
}

TEST_F(DiffCliTest, LevelBytesTellsLayersOnly) {
  write_pair();
  const Json doc = diff_json({"--level", "bytes", "a.apgm", "b.apgm"}, 1);
  EXPECT_EQ(doc["layers"][0]["layers_changed"], 1);
  EXPECT_FALSE(doc["layers"][0].contains("changed"));
  expect_failure(diff({"--level", "bytes", "--top", "1", "a.apgm", "b.apgm"}), 2, "--top needs cells");
  expect_failure(diff({"--level", "bytes", "--png", "x.png", "a.apgm", "b.apgm"}), 2, "--png needs cells");
}

TEST_F(DiffCliTest, ToleranceForgivesSmallChanges) {
  write_pair();
  EXPECT_EQ(diff({"--level", "belief", "a.apgm", "b.apgm"}).code, 1);
  EXPECT_EQ(diff({"--level", "belief", "--tolerance", "0.5", "a.apgm", "b.apgm"}).code, 0);
  EXPECT_EQ(diff({"--level", "belief", "--tolerance", "0.49", "a.apgm", "b.apgm"}).code, 1);
  expect_failure(diff({"--tolerance", "0.1", "a.apgm", "b.apgm"}), 2, "--tolerance goes with --level belief");
  expect_failure(diff({"--level", "belief", "--tolerance", "-1", "a.apgm", "b.apgm"}), 2,
                 "--tolerance takes");
}

TEST_F(DiffCliTest, BoxesAreReadyForCrop) {
  RandomMapOptions options;
  options.types = {LayerType::occupancy()};
  options.frame.datum_x_um = 500'000'300'000;
  options.frame.datum_y_um = 5'400'000'100'000;
  write_random("a.apgm", 5, options);
  const Map map = random_map(5, options);
  Map other = map;
  for (const auto& [key, patch] : map.by_key()) {
    if ((patch.index.x + patch.index.y) % 3 != 0) continue;
    Layer& layer = other.layer(patch.index, 0, patch.layers.begin()->second.step());
    layer.at(0, {1, 1}) = 0.5f;
    layer.at(1, {1, 1}) = 0.125f;
  }
  write("b.apgm", other);
  const Json whole = diff_json({"a.apgm", "b.apgm", "--top", "100"}, 1);
  ASSERT_GT(whole["regions"].size(), 1u);
  double area = 0;
  for (const Json& region : whole["regions"]) {
    std::string box;
    for (const Json& value : region["bbox_m"]) box += (box.empty() ? "" : ",") + value.dump();
    for (const std::string name : {"a", "b"}) {
      ASSERT_EQ(tool("crop", {"--bbox", box, "-O", name + ".apgm", "-o", name + "_part.apgm"}).code, 0);
    }
    const Json part = diff_json({"a_part.apgm", "b_part.apgm"}, 1);
    EXPECT_NEAR(part["layers"][0]["changed"]["area_m2"].get<double>(),
                region["changed_area_m2"].get<double>(), 1e-6);
    area += region["changed_area_m2"].get<double>();
  }
  EXPECT_NEAR(area, whole["layers"][0]["changed"]["area_m2"].get<double>(), 1e-6);
}

TEST_F(DiffCliTest, Filters) {
  write_random("a.apgm", 1);
  write_random("b.apgm", 2);
  const Json doc = diff_json({"--layer", "height", "a.apgm", "b.apgm"}, 1);
  ASSERT_EQ(doc["layers"].size(), 1u);
  EXPECT_TRUE(doc["layers"][0].contains("channels"));
  const Outcome far = diff({"--bbox", "1000,1000,1001,1001", "a.apgm", "b.apgm", "--json"});
  EXPECT_EQ(far.code, 0);
  EXPECT_THAT(far.err, HasSubstr("warning: nothing of 'a.apgm' and 'b.apgm' lies in --bbox"));
  EXPECT_EQ(Json::parse(far.out)["patches"],
            (Json{{"added", 0}, {"removed", 0}, {"changed", 0}, {"equal", 0}}));
  expect_failure(diff({"--layer", "hight", "a.apgm", "b.apgm"}), 2,
                 "neither 'a.apgm' nor 'b.apgm' has a layer 'hight'", "their layers: ");
}

TEST_F(DiffCliTest, PictureShowsTheChange) {
  write_pair();
  EXPECT_EQ(diff({"a.apgm", "b.apgm", "--png", "d.png"}).code, 1);
  EXPECT_EQ(bytes("d.png").substr(1, 3), "PNG");
  expect_failure(diff({"a.apgm", "b.apgm", "--png", "d.png"}), 5, "output 'd.png' already exists",
                 "--overwrite");
  const Json doc = diff_json({"-O", "a.apgm", "b.apgm", "--png", "d.png"}, 1);
  EXPECT_EQ(doc["png"]["layer"], "occupancy");
  EXPECT_EQ(doc["png"]["area_m"], Json({0.0, 0.0, 25.6, 12.8}));
  expect_failure(diff({"-O", "a.apgm", "b.apgm", "--png", "a.apgm"}), 2, "is the input 'a.apgm'");
  expect_failure(diff({"a.apgm", "b.apgm", "--png", "-"}), 2, "--png is not written to standard output");
  expect_failure(diff({"-O", "a.apgm", "b.apgm", "--png", "/dev/full"}), 5, "");
}

TEST_F(DiffCliTest, PicturesOfMapsWithoutLayers) {
  Map map{MapHeader{}};
  write("none.apgm", map);
  EXPECT_EQ(diff({"none.apgm", "none.apgm", "--png", "d.png"}).code, 0);
  EXPECT_TRUE(exists("d.png"));
}

TEST_F(DiffCliTest, SameForAnyNumberOfThreads) {
  write_random("a.apgm", 3);
  write_random("b.apgm", 4);
  const std::string one = diff({"-j1", "--json", "--top", "9", "a.apgm", "b.apgm", "--png", "1.png"}).out;
  std::string two = diff({"-j2", "--json", "--top", "9", "a.apgm", "b.apgm", "--png", "2.png"}).out;
  two.replace(two.find("2.png"), 5, "1.png");
  EXPECT_EQ(one, two);
  EXPECT_EQ(bytes("1.png"), bytes("2.png"));
}

TEST_F(DiffCliTest, MapsThatDoNotFit) {
  write("a.apgm", plain_map(1, 1));
  Frame frame;
  frame.edge_um = 6'400'000;
  write("edge.apgm", plain_map(1, 1, frame));
  expect_failure(diff({"a.apgm", "edge.apgm"}), 7,
                 "cannot compare 'a.apgm' and 'edge.apgm': patch edges differ (12.8 m and 6.4 m)",
                 "apgm-resample --edge 12.8 --datum 0,0");
  frame = {};
  frame.datum_y_um = 100'000;
  write("datum.apgm", plain_map(1, 1, frame));
  expect_failure(diff({"a.apgm", "datum.apgm"}), 7, "datums differ by other than whole cells",
                 "apgm-resample --edge 12.8 --datum 0,0");
  ASSERT_EQ(tool("resample", {"--edge", "12.8", "--datum", "0,0", "datum.apgm", "-o", "fits.apgm"}).code, 0);
  EXPECT_EQ(diff({"a.apgm", "fits.apgm"}).code, 1);
  frame = {};
  frame.frame_id = "odom";
  write("odom.apgm", plain_map(1, 1, frame));
  expect_failure(diff({"a.apgm", "odom.apgm"}), 7, "frames differ ('map' and 'odom')", "--assume-frame map");
  ASSERT_EQ(tool("merge", {"--assume-frame", "map", "odom.apgm", "-o", "renamed.apgm"}).code, 0);
  EXPECT_EQ(diff({"a.apgm", "renamed.apgm"}).code, 0);
}

TEST_F(DiffCliTest, HeadersThatDifferAreTold) {
  write("a.apgm", plain_map(1, 1));
  MapHeader header = plain_map(1, 1).header();
  header.metadata["who"] = "someone";
  header.stamp_ns = 7;
  Map other(header);
  MapSink sink(other);
  copy(plain_map(1, 1), other.header().types, sink, true);
  write("b.apgm", other);
  const Outcome outcome = diff({"a.apgm", "b.apgm"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.out, HasSubstr("headers differ in metadata 'who', stamp\n"));
}

TEST_F(DiffCliTest, BadArguments) {
  write("a.apgm", plain_map(1, 1));
  put("b.apgm", "nothing");
  expect_failure(diff({"a.apgm"}), 2, "one map is given, two are compared");
  expect_failure(diff({"a.apgm", "a.apgm", "c.apgm"}), 2, "unexpected argument 'c.apgm'");
  expect_failure(diff({"-", "-"}), 2, "standard input '-' is named twice");
  expect_failure(diff({"--level", "cell", "a.apgm", "a.apgm"}), 2,
                 "--level takes one of bytes, cells, belief");
  expect_failure(diff({"--top", "0", "a.apgm", "a.apgm"}), 2, "--top takes");
  expect_failure(diff({"a.apgm", "b.apgm"}), 4, "'b.apgm' is not an apgm file");
  expect_failure(diff({"a.apgm", "missing.apgm"}), 4, "missing.apgm");
}

TEST_F(DiffCliTest, ReadsStandardInput) {
  write("a.apgm", plain_map(1, 1));
  Launch launch;
  launch.input = path("a.apgm");
  EXPECT_EQ(tool("diff", {"a.apgm", "-"}, launch).code, 0);
}

}  // namespace
}  // namespace apgm::test
