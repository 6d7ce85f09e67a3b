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
  EXPECT_THAT(foreign, testing::IsSubsetOf({"octomap", "map_server"}));
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
  expect_failure(convert({"a.png", "-o", "b.apgm"}), 4, "PNG image",
                 "apgm-convert reads: octomap, map_server");
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

}  // namespace
}  // namespace apgm::test
