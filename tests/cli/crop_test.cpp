#include "cli_test.hpp"

namespace apgm::test {
namespace {

class CropCliTest : public CliTest {
 protected:
  void SetUp() override { write("a.apgm", plain_map(4, 4)); }
  Outcome crop(std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(), {"a.apgm", "-o", "out.apgm"});
    return tool("crop", arguments);
  }
  std::uint64_t patches() const { return info("out.apgm")["map"]["patches"]; }
};

TEST_F(CropCliTest, BoxKeepsCells) {
  expect_silent(crop({"--bbox", "0,0,1.6,12.8"}));
  const Json document = info("out.apgm", {"--extended"});
  EXPECT_EQ(document["map"]["patches"], 1);
  EXPECT_EQ(document["layers"][0]["known_cells"], 8);
}

TEST_F(CropCliTest, SnapPatchKeepsPatches) {
  expect_silent(crop({"--bbox", "0,0,1.6,12.8", "--snap", "patch"}));
  EXPECT_EQ(info("out.apgm", {"--extended"})["layers"][0]["known_cells"], 64);
}

TEST_F(CropCliTest, NegativeNumbersOfABox) {
  const Outcome outcome = crop({"--bbox", "-10,-10,-5,-5"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("note: the result holds no patches"));
}

TEST_F(CropCliTest, BadBoxIsRefusedBeforeTheInputIsRead) {
  const auto refused = [&](const std::string& box, const std::string& message) {
    expect_failure(tool("crop", {"gone.apgm", "--bbox", box, "-o", "out.apgm"}), 2, message);
  };
  refused("5,0,1,1", "inverted in x");
  refused("0,0,nan,1", "'nan' is not a number");
  refused("0,0,1", "takes 4 numbers, not 3");
  refused("", "takes 4 numbers, not 1");
  refused("0,0,5e9,1", "--bbox: 5e9 lies beyond 4e9 m");
}

TEST_F(CropCliTest, NothingToCropBy) { expect_failure(crop({}), 2, "there is nothing to crop by", "--bbox"); }

TEST_F(CropCliTest, Polygon) {
  put("area.geojson", R"({"type": "Feature", "properties": null, "geometry": {"type": "Polygon",
      "coordinates": [[[0, 0], [25.6, 0], [25.6, 25.6], [0, 25.6], [0, 0]]]}})");
  expect_silent(crop({"--polygon", "area.geojson"}));
  EXPECT_EQ(patches(), 4u);
  expect_silent(crop({"-O", "--polygon", "area.geojson", "--bbox", "0,0,12.8,100"}));
  EXPECT_EQ(patches(), 2u);
}

TEST_F(CropCliTest, BadPolygonNamesFileAndMember) {
  const auto refused = [&](const std::string& text, const std::string& message) {
    put("area.geojson", text);
    expect_failure(crop({"--polygon", "area.geojson"}), 4, message);
    EXPECT_FALSE(exists("out.apgm"));
  };
  refused("{\"type\": ", "'area.geojson' is not JSON: it goes wrong at byte 9");
  refused("", "'area.geojson' is not JSON");
  refused("[]", "'area.geojson': is not a GeoJSON object");
  refused(R"({"type": "Point", "coordinates": [1, 2]})", "is a 'Point', not an area");
  refused(R"({"type": "FeatureCollection", "features": [{"type": "Feature", "geometry": {"type": "Polygon",
      "coordinates": [[[0, 0], [1, "x"], [1, 1], [0, 0]]]}}]})",
          "features[0].geometry.coordinates[0][1] is not a pair of numbers");
  refused(R"({"type": "FeatureCollection", "features": []})", "holds no area");
  expect_failure(crop({"--polygon", "gone.geojson"}), 4,
                 "cannot read 'gone.geojson': No such file or directory");
}

TEST_F(CropCliTest, PolygonFromStandardInput) {
  put("area.geojson", R"({"type": "Polygon",
      "coordinates": [[[0, 0], [25.6, 0], [25.6, 25.6], [0, 25.6], [0, 0]]]})");
  Launch launch;
  launch.input = path("area.geojson");
  expect_silent(tool("crop", {"--polygon", "-", "a.apgm", "-o", "out.apgm"}, launch));
  EXPECT_EQ(patches(), 4u);
  expect_failure(tool("crop", {"-O", "--polygon", "-", "-", "-o", "out.apgm"}, launch), 2,
                 "standard input '-' is named twice");
}

TEST_F(CropCliTest, OutputThatIsThePolygonIsRefused) {
  put("area.geojson", "{}");
  expect_failure(tool("crop", {"-O", "a.apgm", "--polygon", "area.geojson", "-o", "area.geojson"}), 2,
                 "is the input");
  EXPECT_EQ(bytes("area.geojson"), "{}");
}

TEST_F(CropCliTest, LikeAnotherMap) {
  write("b.apgm", plain_map(2, 1));
  expect_silent(crop({"--like", "b.apgm"}));
  EXPECT_EQ(patches(), 2u);
  Frame other;
  other.frame_id = "odom";
  write("c.apgm", plain_map(2, 1, other));
  other.edge_um = 6'400'000;
  write("d.apgm", plain_map(2, 1, other));
  expect_failure(crop({"-O", "--like", "c.apgm"}), 7,
                 "cannot crop 'a.apgm' like 'c.apgm': frames differ ('map' and 'odom')\n", "both need");
  expect_failure(crop({"-O", "--like", "d.apgm"}), 7, "patch edges differ (12.8 m and 6.4 m)");
}

TEST_F(CropCliTest, LayersAlone) {
  write_random("r.apgm", 5);
  expect_silent(tool("crop", {"r.apgm", "--layer", "occupancy", "--layer", "hits", "-o", "out.apgm"}));
  const Json layers = info("out.apgm")["layers"];
  ASSERT_EQ(layers.size(), 2u);
  EXPECT_EQ(layers[0]["name"], "hits");
  EXPECT_EQ(layers[1]["name"], "occupancy");
}

TEST_F(CropCliTest, BadSnap) {
  expect_failure(crop({"--bbox", "0,0,1,1", "--snap", "patches"}), 2,
                 "--snap takes one of cell, patch; not 'patches'", "did you mean 'patch'?");
  expect_failure(crop({"--bbox", "0,0,1,1", "--snap", "xyzzy"}), 2, "not 'xyzzy'", "allowed: cell, patch");
}

TEST_F(CropCliTest, ParametersStandInTheHistory) {
  ASSERT_EQ(crop({"--bbox", "0,0,20,20.5"}).code, 0);
  const Json step = info("out.apgm", {"--history"})["history"][0];
  EXPECT_EQ(step["parameters"]["bbox_m"], Json({0, 0, 20, 20.5}));
  EXPECT_EQ(step["parameters"]["snap"], "cell");
}

TEST_F(CropCliTest, SalvageLeavesOutWhatIsDamaged) {
  const std::string content = bytes("a.apgm");
  bool found = false;
  for (std::size_t at = 64; at < content.size() && !found; at += 16) {
    std::string damaged = content;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    put("a.apgm", damaged);
    if (tool("info", {"a.apgm"}).code != 0 || tool("info", {"--extended", "a.apgm"}).code != 4) continue;
    found = true;
    expect_failure(crop({"--bbox", "0,0,100,100"}), 4, "is damaged: patch (");
    EXPECT_FALSE(exists("out.apgm"));
    const Outcome outcome = crop({"--salvage", "--json"});
    EXPECT_EQ(outcome.code, 3);
    EXPECT_THAT(outcome.err, HasSubstr("apgm-crop: warning: lost: "));
    const Json document = Json::parse(outcome.out);
    EXPECT_EQ(document["damaged_layers"], 1);
    EXPECT_EQ(document["losses"].size(), 1u);
    EXPECT_EQ(patches(), 15u);
  }
  EXPECT_TRUE(found);
}

}  // namespace
}  // namespace apgm::test
