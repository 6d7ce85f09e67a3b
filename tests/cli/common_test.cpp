#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "random_map.hpp"
#include "tools/common/exit_code.hpp"
#include "tools/common/geojson.hpp"
#include "tools/common/help.hpp"
#include "tools/common/json.hpp"
#include "tools/common/parse.hpp"
#include "tools/common/progress.hpp"
#include "tools/common/sketch.hpp"
#include "tools/common/source_view.hpp"
#include "tools/common/suggest.hpp"

namespace apgm::tools {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(ParseTest, NumbersAreReadWholeOrNotAtAll) {
  EXPECT_EQ(parse_real("--x", "-1.5e3"), -1500);
  EXPECT_EQ(parse_integer("--x", "19", 1, 19), 19);
  for (const char* bad : {"", " 1", "1 ", "+1", "1,5", "0x10", "nan", "inf", "1e999", "--1"}) {
    EXPECT_THROW(parse_real("--x", bad), Error) << bad;
    EXPECT_THROW(parse_integer("--x", bad, 0, 100), Error) << bad;
  }
  EXPECT_THROW(parse_integer("--x", "99999999999999999999", 0, 100), Error);
  EXPECT_THROW(parse_positive("--x", "-0"), Error);
}

TEST(ParseTest, SizesTakeDecimalAndBinaryUnits) {
  EXPECT_EQ(parse_size("--m", "4096"), 4096u);
  EXPECT_EQ(parse_size("--m", "1.5GB"), 1'500'000'000u);
  EXPECT_EQ(parse_size("--m", "512MiB"), 536'870'912u);
  EXPECT_EQ(parse_size("--m", "2 tib"), std::uint64_t{1} << 41);
  EXPECT_EQ(parse_size("--m", "64kB"), 64'000u);
  EXPECT_EQ(parse_size("--m", "64k"), 65'536u);
  EXPECT_EQ(parse_size("--m", "1.5G"), std::uint64_t{3} << 29);
  for (const char* bad : {"", "GB", "1.5.5MB", "1Ki", "-1MB", "0", "1e30", "99999999999TiB", "12 parsecs"}) {
    EXPECT_THROW(parse_size("--m", bad), Error) << bad;
  }
}

TEST(ParseTest, BoxesMayHoldBlanks) {
  EXPECT_EQ(parse_box("--bbox", "-10, 0 ,  90.5, 60"), (Box{{-10, 0}, {90.5, 60}}));
  for (const char* bad : {"0,0,1 0,1", "0,0, ,1", "0,0,5e9,1", "-4.1e9,0,1,1"}) {
    EXPECT_THROW(parse_box("--bbox", bad), Error) << bad;
  }
}

TEST(ParseTest, TimesAreUtc) {
  EXPECT_EQ(parse_time("--stamp", "1970-01-01T00:00:01Z"), 1'000'000'000);
  EXPECT_EQ(parse_time("--stamp", "2000-02-29T12:34:56Z"), 951'827'696'000'000'000);
  EXPECT_EQ(parse_time("--stamp", "@-5"), -5'000'000'000);
  EXPECT_GT(parse_time("--stamp", "now"), 1'500'000'000'000'000'000);
  for (const char* bad : {"", "2001-02-29T00:00:00Z", "2001-01-01T24:00:00Z", "2001-01-01 00:00:00Z",
                          "2001-01-01", "@", "@9999999999999"}) {
    EXPECT_THROW(parse_time("--stamp", bad), Error) << bad;
  }
}

TEST(ParseTest, PairsMayDivideAtTheLastSign) {
  EXPECT_EQ(parse_pairs("--set", {"a=b=c"}).at("a"), "b=c");
  EXPECT_EQ(parse_pairs("--discount", {"a=b=0.5"}, true).at("a=b"), "0.5");
  EXPECT_EQ(parse_pairs("--set", {"a="}).at("a"), "");
  EXPECT_THROW(parse_pairs("--set", {"=a"}), Error);
}

TEST(SuggestTest, NearWordsAreFound) {
  EXPECT_EQ(edit_distance("merge", "merge"), 0u);
  EXPECT_EQ(edit_distance("mrege", "merge"), 1u);
  EXPECT_EQ(edit_distance("", "abc"), 3u);
  EXPECT_EQ(nearest("--ovrwrite", {"--output", "--overwrite"}), "--overwrite");
  EXPECT_EQ(nearest("xyzzy", {"--output", "--overwrite"}), "");
  EXPECT_EQ(nearest("", {"a"}), "");
}

TEST(JsonTextTest, KeysAreSortedAndDoublesShortest) {
  const Json value = {{"b", 0.1}, {"a", {1, -2}}, {"c", 12.8}, {"d", std::nan("")}, {"e", Json::object()}};
  EXPECT_EQ(to_line(value), R"({"a": [1, -2], "b": 0.1, "c": 12.8, "d": null, "e": {}})");
  EXPECT_EQ(Json::parse(to_text(value))["b"], 0.1);
}

TEST(JsonTextTest, AnyDoubleReadsBackAsItself) {
  test::Random random(20260131);
  for (int i = 0; i < 10'000; ++i) {
    const auto value = std::bit_cast<double>(random.next());
    if (!std::isfinite(value)) continue;
    EXPECT_EQ(Json::parse(to_line(Json(value))).get<double>(), value) << "seed 20260131, draw " << i;
  }
}

TEST(JsonTextTest, BytesThatAreNotUtf8AreReplaced) { EXPECT_EQ(to_line(Json("a\xff")), "\"a\xef\xbf\xbd\""); }

TEST(FindPathTest, KeysAndNamesMayHoldDots) {
  const Json document = Json::parse(R"({"a": {"b.c": 1}, "l": [{"name": "z0.5", "n": 2}, {"n": 3}]})");
  std::string hint;
  EXPECT_EQ(*find_path(document, "a.b.c", hint), 1);
  EXPECT_EQ(*find_path(document, "l.z0.5.n", hint), 2);
  EXPECT_EQ(*find_path(document, "l.1.n", hint), 3);
  EXPECT_EQ(find_path(document, "l.2.n", hint), nullptr);
  EXPECT_EQ(hint, "'l' holds: z0.5, 1");
  EXPECT_EQ(find_path(document, "l.z0.5.x", hint), nullptr);
  EXPECT_EQ(hint, "'l.z0.5' holds: n, name");
  EXPECT_EQ(find_path(document, "", hint), nullptr);
}

TEST(HumanTextTest, SizesAndCounts) {
  EXPECT_EQ(size_text(0), "0 B");
  EXPECT_EQ(size_text(1023), "1023 B");
  EXPECT_EQ(size_text(1'258'291), "1.2 MiB");
  EXPECT_EQ(size_text(1'048'575), "1.0 MiB");
  EXPECT_EQ(count_text(0), "0");
  EXPECT_EQ(count_text(999), "999");
  EXPECT_EQ(count_text(1'234'567), "1 234 567");
  EXPECT_EQ(plural(1, "patch", "patches"), "1 patch");
}

TEST(HumanTextTest, TableAlignsByColumnsNotBytes) {
  TextTable table({"name", ">n"});
  table.add({"größe", "5"});
  table.add({"b", "123"});
  EXPECT_EQ(table.text(), "name     n\ngröße    5\nb      123\n");
}

TEST(HumanTextTest, WrapKeepsTheWidth) {
  EXPECT_EQ(wrap("one two three", 8, 2), "one two\n  three");
  EXPECT_EQ(wrap("unbreakable", 4, 0), "unbreakable");
}

TEST(ExitCodeTest, CodesAreFrozen) {
  EXPECT_EQ(exit_code(ErrorCode::kInvalidArgument), 2);
  EXPECT_EQ(exit_code(ErrorCode::kUnreadable), 4);
  EXPECT_EQ(exit_code(ErrorCode::kForeign), 4);
  EXPECT_EQ(exit_code(ErrorCode::kDamaged), 4);
  EXPECT_EQ(exit_code(ErrorCode::kUnsupported), 4);
  EXPECT_EQ(exit_code(ErrorCode::kOutput), 5);
  EXPECT_EQ(exit_code(ErrorCode::kLimit), 6);
  EXPECT_EQ(exit_code(ErrorCode::kIncompatible), 7);
  EXPECT_EQ(exit_code(ErrorCode::kCancelled), 130);
}

class ProgressTest : public testing::Test {
 protected:
  Progress::Clock::time_point now_{};
  std::string written_;
  Progress progress_{"merging", [this](const std::string& text) { written_ += text; },
                     [this] { return now_; }};
};

TEST_F(ProgressTest, SilentForHalfASecond) {
  now_ += std::chrono::milliseconds(499);
  progress_.update(1, 10);
  progress_.erase();
  EXPECT_EQ(written_, "");
}

TEST_F(ProgressTest, DrawnAtMostTenTimesASecondAndErased) {
  now_ += std::chrono::seconds(2);
  progress_.update(500, 2000);
  EXPECT_EQ(written_, "\r\x1b[2Kmerging  500 / 2 000 patches  25 %  250/s  6 s left");
  written_.clear();
  now_ += std::chrono::milliseconds(50);
  progress_.update(600, 2000);
  EXPECT_EQ(written_, "");
  progress_.erase();
  EXPECT_EQ(written_, "\r\x1b[2K");
}

TEST_F(ProgressTest, UnknownTotals) { EXPECT_EQ(Progress::line("x", 10, 0, 2), "x  10 patches  5/s"); }

TEST(GeojsonTest, ReadsEveryKindOfArea) {
  const char* ring = "[[0,0],[2,0],[2,2],[0,0]]";
  const std::string polygon = std::string(R"({"type":"Polygon","coordinates":[)") + ring + "," + ring + "]}";
  EXPECT_EQ(parse_geojson(polygon, "f").rings.size(), 2u);
  EXPECT_EQ(parse_geojson(polygon, "f").rings[0].size(), 3u);
  const std::string multi =
      std::string(R"({"type":"MultiPolygon","coordinates":[[)") + ring + "],[" + ring + "]]}";
  EXPECT_EQ(parse_geojson(multi, "f").rings.size(), 2u);
  const std::string feature = R"({"type":"Feature","properties":{},"geometry":)" + polygon + "}";
  const std::string nothing = R"({"type":"Feature","properties":{},"geometry":null})";
  EXPECT_EQ(parse_geojson(feature, "f").rings.size(), 2u);
  const std::string collection =
      R"({"type":"FeatureCollection","features":[)" + feature + "," + nothing + "]}";
  EXPECT_EQ(parse_geojson(collection, "f").rings.size(), 2u);
}

TEST(GeojsonTest, HostileTextIsRefused) {
  std::string deep(100'000, '[');
  for (const std::string& text :
       {deep, std::string("{\"type\":5}"), std::string(R"({"type":"Polygon"})"),
        std::string(R"({"type":"Polygon","coordinates":[[[0,0],[1e999,0],[1,1]]]})"),
        std::string(R"({"type":"Polygon","coordinates":[[[0,0],[1,1]]]})"),
        std::string(
            R"({"type":"FeatureCollection","features":[{"type":"FeatureCollection","features":[]}]})"),
        std::string(R"({"type":"MultiPolygon","coordinates":{"a":1}})")}) {
    EXPECT_THROW(parse_geojson(text, "f"), Error) << text.substr(0, 80);
  }
}

TEST(GeojsonTest, NumbersOutOfRangeNameTheFile) {
  for (const char* number : {"1e999", "5e9"}) {
    const std::string text =
        std::string(R"({"type":"Polygon","coordinates":[[[0,0],[)") + number + ",0],[1,1]]]}";
    try {
      parse_geojson(text, "area.geojson");
      FAIL() << number;
    } catch (const Error& error) {
      EXPECT_THAT(error.message(), HasSubstr("'area.geojson'"));
      EXPECT_THAT(error.hint(), HasSubstr("GeoJSON"));
    }
  }
}

TEST(SketchTest, ShowsPatchesNorthUp) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  Map map(header);
  for (const PatchIndex patch : {PatchIndex{-1, 0}, PatchIndex{0, 0}, PatchIndex{0, 1}, PatchIndex{1, 2}}) {
    map.layer(patch, 0, 0).at(0, {0, 0}) = 1;
  }
  EXPECT_THAT(sketch(map, 10, 10), ElementsAre("  ▄", "▄█ "));
  EXPECT_THAT(sketch(map, 1, 1), ElementsAre("▄"));
  EXPECT_TRUE(sketch(Map(header), 10, 10).empty());
}

TEST(SketchTest, AFarPatchDoesNotTakeMemory) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  Map map(header);
  const auto limit = std::numeric_limits<std::int32_t>::max();
  for (const PatchIndex patch : {PatchIndex{-limit, -limit}, PatchIndex{limit, limit}}) {
    map.layer(patch, 0, 0).at(0, {0, 0}) = 1;
  }
  EXPECT_LE(sketch(map, 60, 16).size(), 16u);
}

TEST(SourceViewTest, HoldsOnlyWhatWasAskedFor) {
  const Map map = test::random_map(11);
  const SourceView view(map, {"semantic", "height"}, {});
  ASSERT_EQ(view.header().types.size(), 2u);
  EXPECT_EQ(view.header().types[0].name, "height");
  PatchInfo info;
  std::uint64_t patches = 0, layers = 0;
  Layer seen;
  for (const auto cursor = view.patches(); cursor->next(info);) {
    ++patches;
    for (const LayerInfo& layer : info.layers) {
      ++layers;
      view.load(layer, seen);
      const auto type = map.header().types.find(view.header().types[layer.type].name);
      EXPECT_TRUE(same_cells(seen, *map.find(info.patch, *type)));
    }
  }
  const Summary summary = view.summary(), whole = map.summary();
  EXPECT_EQ(summary.patches, patches);
  EXPECT_EQ(summary.types[0].layers + summary.types[1].layers, layers);
  EXPECT_EQ(summary.types[0], whole.types[*map.header().types.find("height")]);
}

TEST(SourceViewTest, BoxKeepsThePatchesThatMeetIt) {
  const Map map = test::random_map(12);
  const SourceView view(map, {}, Box{{0, 0}, {12.8, 1}});
  PatchInfo info;
  for (const auto cursor = view.patches(); cursor->next(info);) EXPECT_EQ(info.patch, (PatchIndex{0, 0}));
  for (const auto cursor = view.patches(PatchRange{{5, 5}, {6, 6}}); cursor->next(info);) ADD_FAILURE();
  EXPECT_THROW(SourceView(map, {"nope"}, {}), Error);
}

}  // namespace
}  // namespace apgm::tools
