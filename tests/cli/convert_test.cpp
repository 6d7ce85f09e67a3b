#include "cli_test.hpp"

namespace apgm::test {
namespace {

class ConvertCliTest : public CliTest {
 protected:
  void SetUp() override { write_random("a.apgm", 7); }
  Outcome convert(std::vector<std::string> arguments) const { return tool("convert", arguments); }
};

TEST_F(ConvertCliTest, ListsFormatsWithSettingsAndLosses) {
  const Outcome text = convert({"--formats"});
  EXPECT_EQ(text.code, 0);
  const Json formats = Json::parse(convert({"--formats", "--json"}).out)["formats"];
  std::vector<std::string> foreign;
  for (const Json& format : formats) {
    const std::string name = format["name"];
    EXPECT_THAT(text.out, HasSubstr(name + "  "));
    if (name == "apgm") continue;
    foreign.push_back(name);
    EXPECT_FALSE(format["losses"].empty()) << name;
    std::set<std::string> keys;
    for (const Json& setting : format["settings"]) keys.insert(setting["key"].get<std::string>());
    EXPECT_TRUE(keys.contains("frame_id") && keys.contains("epsg")) << name;
  }
  EXPECT_THAT(foreign, testing::IsSubsetOf({"fixed_grid", "geotiff", "map_server", "numpy", "octomap"}));
}

TEST_F(ConvertCliTest, ReencodingKeepsTheContent) {
  expect_silent(convert({"--level", "19", "a.apgm", "-o", "b.apgm"}));
  EXPECT_EQ(info("b.apgm")["map"]["content_id"], info("a.apgm")["map"]["content_id"]);
}

TEST_F(ConvertCliTest, LayersAreCopiedAsStoredUnlessAskedOtherwise) {
  const Json copied = Json::parse(convert({"--json", "a.apgm", "-o", "b.apgm"}).out);
  EXPECT_EQ(copied["layers_stored"], copied["layers"]);
  const Json packed = Json::parse(convert({"--json", "--level", "9", "a.apgm", "-o", "c.apgm"}).out);
  EXPECT_EQ(packed["layers_stored"], 0);
  EXPECT_EQ(packed["layers"], copied["layers"]);
}

TEST_F(ConvertCliTest, LossyStatesItselfInTheHistory) {
  ASSERT_EQ(convert({"--lossy", "u8", "a.apgm", "-o", "b.apgm"}).code, 0);
  EXPECT_EQ(info("b.apgm", {"--history"})["history"][0]["parameters"]["lossy"], "u8");
}

TEST_F(ConvertCliTest, LayersAndBoxFilter) {
  expect_silent(convert({"--layer", "height", "a.apgm", "-o", "b.apgm"}));
  const Json filtered = info("b.apgm");
  ASSERT_EQ(filtered["layers"].size(), 1u);
  EXPECT_EQ(filtered["layers"][0]["name"], "height");
  write("p.apgm", plain_map(4, 4));
  expect_silent(convert({"--bbox", "0,0,12.8,25.6", "p.apgm", "-o", "c.apgm"}));
  EXPECT_EQ(info("c.apgm")["map"]["patches"], 2);
}

TEST_F(ConvertCliTest, ExtensionThatNamesNoFormat) {
  expect_failure(convert({"a.apgm", "-o", "a.xyz"}), 2, "the extension of 'a.xyz' names no format",
                 "pass --to with one of: apgm");
}

TEST_F(ConvertCliTest, UnknownFormatNames) {
  expect_failure(convert({"--to", "octomop", "a.apgm", "-o", "b"}), 2, "--to takes one of",
                 "did you mean 'octomap'?");
  expect_failure(convert({"--from", "tiff", "a.apgm", "-o", "b.apgm"}), 2, "--from takes one of");
}

TEST_F(ConvertCliTest, UnknownSettings) {
  expect_failure(convert({"--set", "modes=slices", "a.apgm", "-o", "b.bt"}), 2,
                 "--set: no format has a setting 'modes'", "did you mean 'mode'?");
  expect_failure(convert({"--set", "frame_id=x", "a.apgm", "-o", "b.apgm"}), 2,
                 "from apgm to apgm there is not a setting 'frame_id'", "it has no settings");
  expect_failure(convert({"--set", "mode", "a.apgm", "-o", "b.bt"}), 2, "--set takes NAME=VALUE, not 'mode'");
  expect_failure(convert({"--set", "mode=a", "--set", "mode=b", "a.apgm", "-o", "b.bt"}), 2,
                 "--set names 'mode' twice");
}

TEST_F(ConvertCliTest, MapOptionsNeedAMap) {
  expect_failure(convert({"--level", "3", "a.apgm", "-o", "b.bt"}), 2,
                 "--level is for .apgm outputs, not for octomap");
}

TEST_F(ConvertCliTest, ForeignFileWithoutAConverter) {
  put("a.png", "\x89PNG\r\n\x1a\n");
  expect_failure(convert({"a.png", "-o", "b.apgm"}), 4, "PNG image", "apgm-convert reads: apgm");
}

class OctomapCliTest : public ConvertCliTest {
 protected:
  void SetUp() override { write("a.apgm", plain_map(2, 1)); }
};

TEST_F(OctomapCliTest, ThereWithLossAndBack) {
  const Outcome there = convert({"a.apgm", "-o", "a.bt"});
  EXPECT_EQ(there.code, 3) << there.err;
  EXPECT_THAT(there.err, HasSubstr("apgm-convert: warning: lost: "));
  EXPECT_EQ(there.out, "");
  const Outcome back = convert({"a.bt", "--set", "frame_id=yard", "--set", "epsg=25832", "-o", "b.apgm"});
  EXPECT_THAT(back.code, testing::AnyOf(0, 3)) << back.err;
  const Json document = info("b.apgm", {"--history"});
  EXPECT_EQ(document["map"]["frame_id"], "yard");
  EXPECT_EQ(document["map"]["epsg"], 25832);
  EXPECT_EQ(document["history"][0]["operation"], "convert");
  EXPECT_EQ(document["history"][0]["inputs"], Json({"octomap"}));
  EXPECT_EQ(document["history"][0]["parameters"]["set"]["frame_id"], "yard");
}

TEST_F(OctomapCliTest, LossesAreInTheDocument) {
  const Outcome outcome = convert({"--json", "a.apgm", "-o", "a.bt"});
  EXPECT_EQ(outcome.code, 3);
  const Json document = Json::parse(outcome.out);
  EXPECT_FALSE(document["losses"].empty());
  EXPECT_EQ(document["output_format"], "octomap");
}

TEST_F(OctomapCliTest, NoLossAllowedWritesNothing) {
  expect_failure(convert({"--max-loss", "none", "a.apgm", "-o", "a.bt"}), 1,
                 "the conversion would lose data: ", "nothing was written");
  EXPECT_EQ(files(), (std::set<std::string>{"a.apgm"}));
  expect_failure(convert({"--max-loss", "some", "a.apgm", "-o", "a.bt"}), 2,
                 "--max-loss takes one of none, any");
}

TEST_F(OctomapCliTest, ContentCountsNotTheName) {
  ASSERT_EQ(convert({"-q", "a.apgm", "-o", "a.bt"}).code, 3);
  std::filesystem::rename(path("a.bt"), path("tree.apgm"));
  EXPECT_THAT(convert({"tree.apgm", "-o", "b.apgm"}).code, testing::AnyOf(0, 3));
  EXPECT_EQ(tool("info", {"tree.apgm"}).code, 4);
}

TEST_F(OctomapCliTest, TruncatedTree) {
  ASSERT_EQ(convert({"-q", "a.apgm", "-o", "a.bt"}).code, 3);
  const std::string whole = bytes("a.bt");
  put("cut.bt", whole.substr(0, whole.size() - 7));
  expect_failure(convert({"cut.bt", "-o", "b.apgm"}), 4, "cut.bt");
  EXPECT_FALSE(exists("b.apgm"));
}

class MapServerCliTest : public ConvertCliTest {
 protected:
  void SetUp() override {
    put("depot.yaml", yaml());
    put("depot.pgm", kPicture);
  }
  static std::string yaml(const std::string& image = "depot.pgm", const std::string& resolution = "0.1") {
    return "image: " + image + "\nresolution: " + resolution +
           "\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
  }
  const std::string kPicture = std::string("P5\n2 2\n255\n\0\xfe\xcd\0", 15);
};

TEST_F(MapServerCliTest, NoInputIsReplaced) {
  const std::vector<std::vector<std::string>> commands = {
      {"depot.yaml", "-O", "-o", "depot.yml", "--set", "mode=raw"},
      {"depot.yaml", "-O", "-o", "depot.yml"},
      {"depot.yaml", "-O", "-o", "depot.yaml"},
      {"depot.yaml", "-O", "--to", "apgm", "-o", "depot.pgm"}};
  for (const auto& command : commands) {
    expect_failure(convert(command), 2, "is the input '");
    EXPECT_EQ(bytes("depot.pgm"), kPicture);
    EXPECT_EQ(bytes("depot.yaml"), yaml());
    EXPECT_FALSE(exists("depot.yml"));
  }
  std::filesystem::create_symlink("depot.pgm", path("out.pgm"));
  put("out.yaml", yaml("out.pgm"));
  expect_failure(convert({"depot.yaml", "-O", "-o", "out.yaml"}), 2,
                 "output 'out.pgm' is the input 'depot.pgm'");
  EXPECT_EQ(bytes("depot.pgm"), kPicture);
}

TEST_F(MapServerCliTest, AnotherMapsPictureIsNotReplaced) {
  ASSERT_EQ(convert({"depot.yaml", "-o", "a.apgm"}).code, 0);
  expect_failure(convert({"a.apgm", "-O", "-o", "depot.yml"}), 5, "is not that of 'depot.yml'",
                 "choose another name, or remove the picture");
  expect_failure(convert({"a.apgm", "-n", "-O", "-o", "depot.yml"}), 5, "is not that of 'depot.yml'");
  EXPECT_EQ(bytes("depot.pgm"), kPicture);
  EXPECT_FALSE(exists("depot.yml"));
  expect_silent(convert({"a.apgm", "-O", "-o", "depot.yaml"}));
}

TEST_F(MapServerCliTest, RegriddingIsALoss) {
  EXPECT_EQ(convert({"depot.yaml", "--set", "edge_m=10", "-o", "a.apgm"}).code, 3);
  expect_failure(convert({"depot.yaml", "--set", "edge_m=10", "--max-loss", "none", "-o", "b.apgm"}), 1,
                 "the conversion would lose data: ");
  EXPECT_FALSE(exists("b.apgm"));
}

TEST_F(MapServerCliTest, BrokenYamlIsToldAsYaml) {
  put("bad.yaml", "resolution: 1\nimage: [");
  expect_failure(convert({"bad.yaml", "-o", "a.apgm"}), 4, "'bad.yaml' is not valid YAML in line ",
                 "key: value");
  put("short.yml", "image: [");
  expect_failure(convert({"short.yml", "-o", "a.apgm"}), 4, "'short.yml' is not valid YAML in line ");
}

TEST_F(MapServerCliTest, HintsForBadMaps) {
  put("gone.yaml", yaml("gone.pgm"));
  expect_failure(convert({"gone.yaml", "-o", "a.apgm"}), 4, "gone.pgm", "key 'image' of the YAML names it");
  for (const char* resolution : {".nan", "1e300", "0"}) {
    put("bad.yaml", yaml("depot.pgm", resolution));
    expect_failure(convert({"bad.yaml", "-o", "a.apgm"}), 4, "key 'resolution' of the map is '",
                   "metres a pixel, such as 0.05");
  }
  expect_failure(convert({"no.yaml", "-o", "a.apgm"}), 4, "cannot open 'no.yaml'", "check the name");
}

TEST_F(MapServerCliTest, BadValuesAreRefusedBeforeTheInputIsOpened) {
  for (const char* input : {"depot.yaml", "gone.yaml", "gone.bt", "gone"}) {
    const Outcome outcome = convert({input, "--set", "edge_m=wide", "-o", "a.apgm"});
    expect_failure(outcome, 2, "setting 'edge_m=wide' of format ");
    EXPECT_THAT(outcome.err, testing::Not(HasSubstr(input)));
  }
  expect_failure(convert({"gone.yaml", "--set", "mode=slices", "--from", "map_server", "-o", "a.apgm"}), 2,
                 "setting 'mode=slices' of format 'map_server' is not one of trinary, scale, raw");
  expect_failure(convert({"gone.apgm", "--set", "occupied_thresh=2", "-o", "a.yaml"}), 2,
                 "setting 'occupied_thresh=2'");
}

TEST_F(MapServerCliTest, ForeignAndEmptyInputsAreTold) {
  put("empty", "");
  expect_failure(convert({"empty", "-o", "a.apgm"}), 4, "'empty' is empty", "nothing was written to it");
  put("noise.dat", "\x01\x02\xff");
  expect_failure(convert({"noise.dat", "-o", "a.apgm"}), 4, "'noise.dat' is of no format apgm-convert reads",
                 "apgm-convert reads: apgm, ");
}

TEST_F(MapServerCliTest, StandardStreamsAreForMaps) {
  put("a.bt", "# Octomap OcTree binary file\nid OcTree\nsize 0\nres 0.1\ndata\n");
  Launch launch;
  launch.input = path("a.bt");
  expect_failure(tool("convert", {"-", "-o", "a.apgm"}, launch), 4, "octomap is not read from standard input",
                 "pass the file by its name");
  expect_failure(convert({"--from", "octomap", "-", "-o", "a.apgm"}), 2,
                 "octomap is not read from standard input");
  expect_failure(
      run({"/bin/sh", "-c",
           "cat '" + path("a.bt") + "' | '" + command("convert", {})[0] + "' - -o '" + path("a.apgm") + "'"}),
      4, "octomap is not read from standard input");
  expect_failure(convert({"depot.yaml", "--to", "octomap", "-o", "-"}), 2,
                 "octomap is not written to standard output", "name a file with -o");
  ASSERT_EQ(convert({"depot.yaml", "-o", "a.apgm"}).code, 0);
  launch.input = path("a.apgm");
  expect_silent(tool("convert", {"-", "-o", "b.apgm"}, launch));
  expect_silent(run(
      {"/bin/sh", "-c",
       "cat '" + path("a.apgm") + "' | '" + command("convert", {})[0] + "' - -o '" + path("c.apgm") + "'"}));
  EXPECT_EQ(info("c.apgm")["map"]["content_id"], info("b.apgm")["map"]["content_id"]);
}

class RasterCliTest : public CliTest {
 protected:
  /// Two classes, 7 and 9, as an ASCII raster of 4 x 4 cells.
  void SetUp() override {
    put("land.asc",
        "ncols 4\nnrows 4\nxllcorner 0\nyllcorner 0\ncellsize 1\n7 7 7 7\n7 7 9 9\n7 7 9 9\n9 9 9 9\n");
    put("legend.csv", "7,Road\n9,Grass\n");
  }
  Outcome convert(std::vector<std::string> arguments) const { return tool("convert", arguments); }
  const std::vector<std::string> import_{"land.asc",   "--set", "legend=legend.csv", "--set",
                                         "epsg=32632", "--set", "edge_m=4"};
};

TEST_F(RasterCliTest, TheNameOfALegendStaysOutOfTheHistory) {
  std::vector<std::string> arguments = import_;
  arguments.insert(arguments.end(), {"-o", "land.apgm"});
  ASSERT_EQ(convert(arguments).code, 0);
  const Json history = info("land.apgm", {"--history"})["history"];
  EXPECT_EQ(history[0]["parameters"]["set"], (Json{{"epsg", "32632"}, {"edge_m", "4"}}));
}

TEST_F(RasterCliTest, ALegendIsNoOutput) {
  std::vector<std::string> arguments = import_;
  arguments.insert(arguments.end(), {"-O", "-o", "legend.csv"});
  EXPECT_EQ(convert(arguments).code, 2);
  EXPECT_EQ(bytes("legend.csv"), "7,Road\n9,Grass\n");
}

TEST_F(RasterCliTest, MapsReturnFromRastersAndArrays) {
  write_random("a.apgm", 3);
  for (const std::string name : {"a.tif", "a.npz"}) {
    const Outcome out = convert({"a.apgm", "--layer", "occupancy", "-o", name});
    ASSERT_TRUE(out.code == 0 || out.code == 3) << out.err;
    ASSERT_EQ(convert({name, "-o", name + ".apgm"}).code, 0);
  }
  // Rasters have one cell size, arrays keep each layer's own.
  ASSERT_EQ(convert({"a.apgm", "--layer", "occupancy", "-o", "only.apgm"}).code, 0);
  EXPECT_EQ(info("a.npz.apgm")["map"]["content_id"], info("only.apgm")["map"]["content_id"]);
  EXPECT_EQ(info("a.tif.apgm")["map"]["bbox_m"], info("only.apgm")["map"]["bbox_m"]);
}

}  // namespace
}  // namespace apgm::test
