#include <xxhash.h>

#include <cstdint>
#include <cstring>

#include "cli_test.hpp"

namespace apgm::test {
namespace {

class InfoCliTest : public CliTest {};

TEST_F(InfoCliTest, DocumentHoldsTheContract) {
  Frame frame;
  frame.datum_x_um = 500'000'000;
  frame.datum_y_um = -1'500'000;
  frame.epsg = 32632;
  frame.frame_id = "site";
  write("a.apgm", plain_map(3, 2, frame));
  const Json document = info("a.apgm");
  EXPECT_EQ(document["schema"], "apgm.info/1");
  const Json& map = document["map"];
  EXPECT_EQ(map["edge_m"], 12.8);
  EXPECT_EQ(map["datum_m"], Json({500, -1.5}));
  EXPECT_EQ(map["epsg"], 32632);
  EXPECT_EQ(map["frame_id"], "site");
  EXPECT_EQ(map["patches"], 6);
  EXPECT_EQ(map["bbox_m"], Json({500, -1.5, 538.4, 24.1}));
  EXPECT_THAT(map["content_id"].get<std::string>(), testing::MatchesRegex("[0-9a-f]+"));
  ASSERT_EQ(document["layers"].size(), 1u);
  const Json& layer = document["layers"][0];
  EXPECT_EQ(layer["name"], "occupancy");
  EXPECT_EQ(layer["hypotheses"].size(), 2u);
  EXPECT_EQ(layer["channels"].size(), 2u);
  EXPECT_EQ(layer["policy"], "conditional");
  EXPECT_EQ(layer["patches"], 6);
  EXPECT_EQ(layer["cells"], 6 * 64);
  EXPECT_EQ(layer["steps"], Json({{"3", 6}}));
  EXPECT_EQ(layer["raw_bytes"], 6 * 64 * 8);
  EXPECT_GT(layer["stored_bytes"], 0);
  EXPECT_FALSE(layer.contains("known_cells"));
  EXPECT_EQ(document["file"]["bytes"], bytes("a.apgm").size());
  EXPECT_EQ(document["file"]["format_version"], "1.0");
  EXPECT_EQ(document["file"]["archive"], false);
  EXPECT_EQ(document["file"]["commits"], 1);
}

TEST_F(InfoCliTest, KeysAreSortedAndNumbersShort) {
  write("a.apgm", plain_map(1, 1));
  const std::string text = tool("info", {"--json", "a.apgm"}).out;
  EXPECT_LT(text.find("\"file\""), text.find("\"layers\""));
  EXPECT_LT(text.find("\"layers\""), text.find("\"map\""));
  EXPECT_THAT(text, HasSubstr("\"edge_m\": 12.8,"));
}

TEST_F(InfoCliTest, SlabIsTold) {
  MapHeader header;
  LayerType type = LayerType::occupancy("low");
  type.slab = Slab{-500'000, 250'000};
  header.types = TypeTable({type});
  write("a.apgm", Map(header));
  EXPECT_EQ(info("a.apgm")["layers"][0]["slab_m"], Json({-0.5, 0.25}));
  EXPECT_THAT(tool("info", {"a.apgm"}).out, HasSubstr("low [-0.5, 0.25) m"));
}

TEST_F(InfoCliTest, ExtendedCountsCells) {
  Map map = plain_map(1, 1);
  Layer& layer = map.layer({0, 0}, 0, 3);
  layer.at(0, {0, 0}) = 0.75f;
  layer.at(1, {0, 0}) = 0.125f;
  layer.at(0, {1, 0}) = 0;
  layer.at(1, {1, 0}) = 0;
  write("a.apgm", map);
  const Json counted = info("a.apgm", {"--extended"})["layers"][0];
  EXPECT_EQ(counted["known_cells"], 63);
  EXPECT_EQ(counted["occupied_cells"], 1);
  EXPECT_EQ(counted["free_cells"], 62);
  EXPECT_EQ(counted["max_mass_sum"], 0.875);
}

TEST_F(InfoCliTest, TextNamesWhatIsUnknown) {
  write("a.apgm", plain_map(2, 1));
  const Outcome outcome = tool("info", {"a.apgm"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_EQ(outcome.err, "");
  EXPECT_THAT(outcome.out, HasSubstr("EPSG unknown"));
  EXPECT_THAT(outcome.out, HasSubstr("2 of 12.8 m x 12.8 m"));
  EXPECT_THAT(outcome.out, HasSubstr("0, 0, 25.6, 12.8 m"));
}

TEST_F(InfoCliTest, EmptyMapSaysSo) {
  write("a.apgm", empty_map());
  EXPECT_THAT(tool("info", {"a.apgm"}).out, HasSubstr("the map holds no patches"));
  EXPECT_TRUE(info("a.apgm")["map"]["bbox_m"].is_null());
}

TEST_F(InfoCliTest, GetPrintsBareValues) {
  write("a.apgm", plain_map(3, 2));
  const auto get = [&](const std::string& where) { return tool("info", {"--get", where, "a.apgm"}).out; };
  EXPECT_EQ(get("map.patches"), "6\n");
  EXPECT_EQ(get("map.edge_m"), "12.8\n");
  EXPECT_EQ(get("map.frame_id"), "map\n");
  EXPECT_EQ(get("map.epsg"), "null\n");
  EXPECT_EQ(get("layers.0.cells"), "384\n");
  EXPECT_EQ(get("layers.occupancy.steps.3"), "6\n");
  EXPECT_EQ(get("map.datum_m"), "[0, 0]\n");
}

TEST_F(InfoCliTest, GetOfAnUnknownPathNamesTheKeys) {
  write("a.apgm", plain_map(1, 1));
  expect_failure(tool("info", {"--get", "map.patchez", "a.apgm"}), 2, "--get: there is no 'map.patchez'",
                 "'map' holds: bbox_m, content_id, datum_m, edge_m, epsg, frame_id");
  expect_failure(tool("info", {"--get", "maps", "a.apgm"}), 2, "there is no 'maps'",
                 "keys: file, layers, map");
  expect_failure(tool("info", {"--get", "layers.0.known_cells", "a.apgm"}), 2, "there is no",
                 "counts of cells need --extended");
}

TEST_F(InfoCliTest, GetAsJson) {
  write("a.apgm", plain_map(1, 1));
  const Json document = info("a.apgm", {"--get", "map.patches"});
  EXPECT_EQ(document["value"], 1);
  EXPECT_EQ(document["path"], "map.patches");
}

TEST_F(InfoCliTest, FiltersByLayerAndBox) {
  write_random("a.apgm", 3);
  const Json filtered = info("a.apgm", {"--layer", "height"});
  ASSERT_EQ(filtered["layers"].size(), 1u);
  EXPECT_EQ(filtered["layers"][0]["name"], "height");
  const Json whole = info("a.apgm");
  for (const Json& layer : whole["layers"]) {
    if (layer["name"] != "height") continue;
    EXPECT_EQ(layer["cells"], filtered["layers"][0]["cells"]);
  }
  write("b.apgm", plain_map(4, 4));
  EXPECT_EQ(info("b.apgm", {"--bbox", "0,0,12.8,25.6"})["map"]["patches"], 2);
  EXPECT_EQ(info("b.apgm", {"--bbox", "-50,-50,-40,-40"})["map"]["patches"], 0);
}

TEST_F(InfoCliTest, BadBoxes) {
  const auto refused = [&](const std::string& box, const std::string& message) {
    expect_failure(tool("info", {"--bbox", box, "a.apgm"}), 2, message, "XMIN,YMIN,XMAX,YMAX");
  };
  refused("0,0,1", "--bbox takes 4 numbers, not 3: '0,0,1'");
  refused("0,0,1,1,1", "--bbox takes 4 numbers, not 5");
  refused("0,0,nan,1", "--bbox: 'nan' is not a number");
  refused("0,0,inf,1", "--bbox: 'inf' is not a number");
  refused("0,0,1m,1", "--bbox: '1m' is not a number");
  refused("0,0,,1", "--bbox: '' is not a number");
  refused("5,0,1,1", "--bbox: the box is inverted in x: 5 to 1");
  refused("0,2,1,2", "--bbox: the box is empty in y: 2 to 2");
}

TEST_F(InfoCliTest, HistoryIsPrinted) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  header.history = {{"convert", {"octomap"}, R"({"set":{"z_min":"0"}})"}, {"crop", {"abc"}, "not json"}};
  write("a.apgm", Map(header));
  const Json history = info("a.apgm", {"--history"})["history"];
  EXPECT_EQ(history[0]["parameters"]["set"]["z_min"], "0");
  EXPECT_EQ(history[1]["parameters"], "not json");
  const std::string text = tool("info", {"--history", "a.apgm"}).out;
  EXPECT_LT(text.find("convert"), text.find("crop"));
  EXPECT_FALSE(info("a.apgm").contains("history"));
}

TEST_F(InfoCliTest, SecondInputIsUnexpected) {
  expect_failure(tool("info", {"a.apgm", "b.apgm"}), 2, "unexpected argument 'b.apgm'");
}

TEST_F(InfoCliTest, NameThatStartsWithADash) {
  write("-a.apgm", plain_map(1, 1));
  EXPECT_EQ(tool("info", {"--get", "map.patches", "--", "-a.apgm"}).out, "1\n");
}

TEST_F(InfoCliTest, ControlCharactersOfANameDoNotReachTheTerminal) {
  const Outcome outcome = tool("info", {"a\x1b[31m.apgm"});
  EXPECT_EQ(outcome.code, 4);
  EXPECT_EQ(outcome.err.find('\x1b'), std::string::npos);
  EXPECT_THAT(outcome.err, HasSubstr("a\\x1b[31m.apgm"));
}

TEST_F(InfoCliTest, ColorIsForced) {
  EXPECT_THAT(tool("info", {"--color", "always", "gone"}).err, HasSubstr("\x1b[1;31merror:\x1b[0m"));
  EXPECT_EQ(tool("info", {"gone"}).err.find('\x1b'), std::string::npos);
}

TEST_F(InfoCliTest, TooNewFile) {
  write("a.apgm", plain_map(1, 1));
  std::string content = bytes("a.apgm");
  content[8] = 2;  // the major version
  const std::uint64_t hash = XXH3_64bits(content.data(), 56);
  std::memcpy(content.data() + 56, &hash, sizeof(hash));
  put("a.apgm", content);
  expect_failure(tool("info", {"a.apgm"}), 4, "'a.apgm' is of format 2.0",
                 "a newer version of apgm can read it");
}

TEST_F(InfoCliTest, DamageInALayerIsFoundOnlyWhenItIsRead) {
  write("a.apgm", plain_map(1, 1));
  std::string content = bytes("a.apgm");
  // The first block after the 64 bytes of preamble is the map header; flip bits until a layer is hit.
  bool found = false;
  for (std::size_t at = 64; at < content.size() && !found; at += 16) {
    std::string damaged = content;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    put("b.apgm", damaged);
    if (tool("info", {"b.apgm"}).code != 0) continue;
    const Outcome read = tool("info", {"--extended", "b.apgm"});
    EXPECT_EQ(read.code, 4) << "byte " << at;
    EXPECT_THAT(read.err, HasSubstr("is damaged: patch (0,0) layer 'occupancy'"));
    found = true;
  }
  EXPECT_TRUE(found);
}

}  // namespace
}  // namespace apgm::test
