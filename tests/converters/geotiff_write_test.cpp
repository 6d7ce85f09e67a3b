#include <atomic>
#include <cmath>
#include <filesystem>

#include "tests/converters/geotiff_support.hpp"

namespace apgm::converters {
namespace {

using testing::collect;
using ::testing::Contains;
using testing::content_id;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::one_layer;
using testing::open;
using testing::output_of;
using ::testing::SizeIs;
using testing::write;
using Json = nlohmann::json;

std::vector<LayerType> all_types() {
  LayerType slab = LayerType::occupancy("low", Policy::kExclusive);
  slab.slab = Slab{-500'000, 1'250'000};
  return {LayerType::occupancy(),
          slab,
          LayerType::real("height", {"z", "z_max"}, Policy::kMaximum),
          LayerType::real("hits", {"n"}, Policy::kSum),
          LayerType::semantic("semantic", {"road", "marking", "blocked"}),
          LayerType{"pair", {"A", "B"}, {"A", "B"}, Policy::kMean, {}}};
}

/// Stamps of all layers, in the order of the patches.
std::vector<std::int64_t> stamps(const PatchSource& source) {
  std::vector<std::int64_t> list;
  const auto cursor = source.patches();
  PatchInfo patch;
  while (cursor->next(patch)) {
    for (const LayerInfo& info : patch.layers) list.push_back(info.stamp_ns);
  }
  return list;
}

class RoundTrip : public ::testing::TestWithParam<int> {};

TEST_P(RoundTrip, KeepsContentIdAndStamps) {
  const int step = GetParam();
  std::uint64_t seed = 40 + static_cast<std::uint64_t>(step);
  for (const LayerType& type : all_types()) {
    SCOPED_TRACE(type.name + " at step " + std::to_string(step) + ", seed " + std::to_string(++seed));
    auto options = one_layer(type, step);
    options.frame.frame_id = "site \"A\" <1>";
    options.frame.edge_um = 12'345'678;
    options.frame.datum_x_um = 569'974'400'001;
    options.frame.datum_y_um = -5'359'961'600'003;
    if (seed % 2 == 0) options.frame.epsg = 32632;
    if (step > 8) options.range = {{-1, 2}, {0, 2}};
    if (step > 8) options.fill = 1;
    Map map = test::random_map(seed, options);
    map.set_stamp_ns(1'700'000'000'000'000'123);
    const testing::TempDir dir;
    testing::Collected findings;
    write(geotiff(), map, dir / "a.tif", {}, &findings);
    const auto source = open(geotiff(), dir / "a.tif", {}, &findings);
    EXPECT_THAT(findings.list, IsEmpty());
    EXPECT_EQ(content_id(map), content_id(*source));
    EXPECT_EQ(stamps(map), stamps(*source));
    EXPECT_EQ(source->header().types, map.header().types);
    EXPECT_EQ(source->header().frame, map.header().frame);
    EXPECT_EQ(source->header().stamp_ns, map.header().stamp_ns);
  }
}

INSTANTIATE_TEST_SUITE_P(Steps, RoundTrip, ::testing::Values(0, 1, 4, 7, 8, 10));

TEST(GeoTiffWriter, EveryCompressionKeepsTheContentAndRepeatsItsBytes) {
  const Map map = test::random_map(3, one_layer(LayerType::occupancy(), 7));
  for (const Settings& settings :
       {Settings{}, Settings{{"compression", "deflate"}}, Settings{{"compression", "none"}},
        Settings{{"compression", "zstd"}, {"level", "9"}}}) {
    const testing::TempDir dir;
    write(geotiff(), map, dir / "a.tif", settings);
    write(geotiff(), map, dir / "b.tif", settings);
    EXPECT_EQ(content_id(map), content_id(*open(geotiff(), dir / "a.tif")));
    EXPECT_TRUE(testing::read_text(dir / "a.tif") == testing::read_text(dir / "b.tif"));
    EXPECT_FALSE(std::filesystem::exists(dir / "a.tif.aux.xml"));
  }
}

TEST(GeoTiffWriter, EmptyMapComesBackEmpty) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  const Map map(header);
  const testing::TempDir dir;
  testing::Collected findings;
  write(geotiff(), map, dir / "a.tif", {}, &findings);
  EXPECT_THAT(findings.of(Finding::Kind::kWarning), ElementsAre(HasSubstr("no known cells")));
  EXPECT_EQ(content_id(map), content_id(*open(geotiff(), dir / "a.tif")));
}

TEST(GeoTiffWriter, GdalSeesCrsExtentNoDataAndNames) {
  auto options = one_layer(LayerType::semantic("semantic", {"road", "marking"}), 6);
  options.frame.epsg = 32632;
  options.frame.datum_x_um = 570'000'000'000;
  options.frame.datum_y_um = 5'360'000'000'000;
  options.fill = 1;
  const Map map = test::random_map(5, options);
  const testing::TempDir dir;
  write(geotiff(), map, dir / "a.tif");
  const auto text = output_of("gdalinfo -json '" + (dir / "a.tif") + "'");
  if (!text) GTEST_SKIP() << "gdalinfo is not there";
  const Json info = Json::parse(*text);
  EXPECT_EQ(info["stac"]["proj:epsg"], 32632);
  EXPECT_EQ(info["size"], Json({6 * 64, 6 * 64}));
  const Box box = map.header().frame.box_m(map.summary().range);
  EXPECT_NEAR(info["cornerCoordinates"]["lowerLeft"][0], box.min.x_m, 1e-6);
  EXPECT_NEAR(info["cornerCoordinates"]["lowerLeft"][1], box.min.y_m, 1e-6);
  EXPECT_NEAR(info["cornerCoordinates"]["upperRight"][0], box.max.x_m, 1e-6);
  EXPECT_NEAR(info["cornerCoordinates"]["upperRight"][1], box.max.y_m, 1e-6);
  ASSERT_THAT(info["bands"], SizeIs(3));
  const std::vector<std::string> names{"road", "marking", "Omega"};
  for (std::size_t i = 0; i < names.size(); ++i) {
    EXPECT_EQ(info["bands"][i]["description"], names[i]);
    EXPECT_EQ(info["bands"][i]["type"], "Float32");
    EXPECT_EQ(info["bands"][i]["noDataValue"], "NaN");
  }
  EXPECT_EQ(info["metadata"]["IMAGE_STRUCTURE"]["COMPRESSION"], "ZSTD");
}

TEST(GeoTiffWriter, MapsWithoutEpsgGetALocalCrsInMetres) {
  const Map map = test::random_map(5, one_layer(LayerType::occupancy(), 3));
  const testing::TempDir dir;
  write(geotiff(), map, dir / "a.tif");
  const auto text = output_of("gdalinfo '" + (dir / "a.tif") + "'");
  if (!text) GTEST_SKIP() << "gdalinfo is not there";
  EXPECT_THAT(*text, HasSubstr("ENGCRS[\"map\""));
  EXPECT_EQ(open(geotiff(), dir / "a.tif")->header().frame.epsg, std::nullopt);
}

TEST(GeoTiffWriter, CodesThatAreNoMetresAreALoss) {
  for (const int epsg : {4326, 999'999}) {
    auto options = one_layer(LayerType::occupancy(), 3);
    options.frame.epsg = epsg;
    const Map map = test::random_map(5, options);
    const testing::TempDir dir;
    testing::Collected findings;
    write(geotiff(), map, dir / "a.tif", {}, &findings);
    EXPECT_THAT(findings.losses(), ElementsAre(HasSubstr("EPSG:" + std::to_string(epsg))));
    EXPECT_EQ(content_id(map), content_id(*open(geotiff(), dir / "a.tif")));
  }
}

/// Cells of `part` that are not those of `whole`; and how many it holds data in.
std::pair<std::size_t, std::size_t> compare_cells(const Map& part, const Map& whole, int step) {
  std::size_t differing = 0, known = 0;
  for (const auto& [key, patch] : part.by_key()) {
    const Layer& layer = patch.layers.at(0);
    for (int b = 0; b < layer.side(); ++b) {
      for (int a = 0; a < layer.side(); ++a) {
        if (layer.at(0, {a, b}) == 0 && layer.at(1, {a, b}) == 0) continue;
        ++known;
        const Point corner = part.header().frame.origin_m(patch.index);
        const double cell = part.header().frame.cell_m(step);
        const double x = corner.x_m + (a + 0.5) * cell, y = corner.y_m + (b + 0.5) * cell;
        differing += testing::masses_at(whole, "occupancy", x, y, step) !=
                     std::pair(layer.at(0, {a, b}), layer.at(1, {a, b}));
      }
    }
  }
  return {differing, known};
}

TEST(GeoTiffWriter, GdalTranslateCutsItRight) {
  auto options = one_layer(LayerType::occupancy(), 5);
  options.frame.epsg = 32632;
  options.fill = 1;
  const Map map = test::random_map(11, options);
  const testing::TempDir dir;
  write(geotiff(), map, dir / "a.tif");
  // x -10..14, y -6..10, in cells of 0.4 m
  if (!output_of("gdal_translate -q -projwin -10 10 14 -6 '" + (dir / "a.tif") + "' '" + (dir / "b.tif") +
                 "'"))
    GTEST_SKIP() << "gdal_translate is not there";
  testing::Collected findings;
  const auto source = open(geotiff(), dir / "b.tif", {{"as", "masses"}, {"datum", "0,0"}}, &findings);
  const Map part = collect(*source);
  EXPECT_THAT(findings.list, IsEmpty());
  EXPECT_EQ(part.header().frame.epsg, 32632);
  EXPECT_EQ(part.header().frame.edge_um, map.header().frame.edge_um);
  const auto [differing, known] = compare_cells(part, map, 5);
  EXPECT_EQ(differing, 0u);
  std::size_t expected = 0;
  for (int j = -15; j < 25; ++j) {
    for (int i = -25; i < 35; ++i) {
      expected +=
          testing::masses_at(map, "occupancy", (i + 0.5) * 0.4, (j + 0.5) * 0.4, 5) != std::pair(0.f, 0.f);
    }
  }
  EXPECT_EQ(known, expected);
  EXPECT_GT(known, 100u);
}

TEST(GeoTiffWriter, CoarserLayersAreSplitFinerOnesMerged) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  Map map(header);
  map.layer({0, 0}, 0, 4).at(0, {1, 1}) = 0.75f;
  map.layer({1, 0}, 0, 3).at(0, {1, 1}) = 0.75f;
  const testing::TempDir dir;
  testing::Collected findings;
  write(geotiff(), map, dir / "a.tif", {}, &findings);
  EXPECT_THAT(findings.losses(), ElementsAre("1 layers of coarser cells are split to step 4"));
  const Map fine = collect(*open(geotiff(), dir / "a.tif"));
  EXPECT_EQ(fine.find({0, 0}, 0)->at(0, {1, 1}), 0.75f);
  EXPECT_NEAR(fine.find({1, 0}, 0)->at(0, {2, 2}), 1 - std::pow(0.25, 0.25), 1e-6);

  testing::Collected merged;
  write(geotiff(), map, dir / "b.tif", {{"step", "3"}}, &merged);
  EXPECT_THAT(merged.losses(), ElementsAre("1 layers of finer cells are merged to step 3"));
  EXPECT_EQ(collect(*open(geotiff(), dir / "b.tif")).find({0, 0}, 0)->at(0, {0, 0}), 0.75f);
}

TEST(GeoTiffWriter, ClassesHaveNamesColoursAndTheGreatestBelief) {
  MapHeader header;
  const LayerType layer_type = LayerType::semantic("ground", {"road", "grass"});
  header.types = TypeTable({layer_type});
  Map map(header);
  Layer& layer = map.layer({2, 3}, 0, 2);
  const auto set = [&](CellIndex at, float road, float grass) {
    layer.at(0, at) = road, layer.at(1, at) = grass, layer.at(2, at) = 1 - road - grass;
  };
  set({0, 0}, 0.25f, 0.5f);
  set({1, 0}, 0.5f, 0.25f);
  set({2, 0}, 0.25f, 0.25f);
  const testing::TempDir dir;
  testing::Collected findings;
  write(geotiff(), map, dir / "a.tif", {{"mode", "classes"}}, &findings);
  EXPECT_THAT(findings.losses(), ElementsAre("3 cells keep only the class of the greatest BetP"));
  const Map back = collect(*open(geotiff(), dir / "a.tif", {{"class_mass", "0.5"}}));
  const Layer& read = *back.find({2, 3}, 0);
  EXPECT_EQ(read.at(1, {0, 0}), 0.5f);
  EXPECT_EQ(read.at(0, {1, 0}), 0.5f);
  EXPECT_EQ(read.at(0, {2, 0}), 0.5f);
  EXPECT_EQ(read.at(2, {3, 3}), 1.0f);
  // Written and read again it is the same: what a class stands for is told in both.
  testing::Collected none;
  write(geotiff(), back, dir / "b.tif", {{"mode", "classes"}}, &none);
  EXPECT_THAT(none.list, IsEmpty());
  EXPECT_EQ(content_id(back), content_id(*open(geotiff(), dir / "b.tif")));

  // GDAL's own copy keeps the names, not the metadata.
  if (output_of("gdal_translate -q -srcwin 0 0 3 4 '" + (dir / "a.tif") + "' '" + (dir / "c.tif") + "'")) {
    EXPECT_EQ(open(geotiff(), dir / "c.tif")->header().types[0].hypotheses, layer_type.hypotheses);
  }

  const auto text = output_of("gdalinfo -json '" + (dir / "a.tif") + "'");
  if (!text) GTEST_SKIP() << "gdalinfo is not there";
  const Json band = Json::parse(*text)["bands"][0];
  EXPECT_EQ(band["type"], "Byte");
  EXPECT_EQ(band["noDataValue"], 0.0);
  EXPECT_EQ(band["categories"], Json({"unknown", "road", "grass"}));
  EXPECT_EQ(band["colorTable"]["entries"][1], Json({86, 180, 233, 255}));
}

TEST(GeoTiffWriter, OneLayerIsChosenOthersAreListed) {
  test::RandomMapOptions options;
  options.min_step = options.max_step = 3;
  const Map map = test::random_map(8, options);
  const testing::TempDir dir;
  testing::Collected findings;
  write(geotiff(), map, dir / "a.tif", {}, &findings);
  EXPECT_THAT(findings.losses(), SizeIs(3));
  EXPECT_THAT(findings.losses(), Contains(HasSubstr("layer 'height' is left out")));
  write(geotiff(), map, dir / "b.tif", {}, nullptr, "height");
  EXPECT_EQ(open(geotiff(), dir / "b.tif")->header().types[0].name, "height");
  EXPECT_EQ(testing::error_of([&] { write(geotiff(), map, dir / "c.tif", {}, nullptr, "gone"); }).message(),
            "the map has no layer 'gone'");
  EXPECT_EQ(testing::error_of([&] {
              write(geotiff(), map, dir / "c.tif", {{"mode", "classes"}}, nullptr, "height");
            }).message(),
            "layer 'height' holds values, not classes");
  options.types.erase(options.types.begin());
  const Map without = test::random_map(8, options);
  const Error error = testing::error_of([&] { write(geotiff(), without, dir / "c.tif"); });
  EXPECT_EQ(error.message(), "the map has several layers, and a GeoTIFF holds one");
  EXPECT_EQ(error.hint(), "choose one with --layer: height, hits, semantic");
  EXPECT_FALSE(std::filesystem::exists(dir / "c.tif"));
}

TEST(GeoTiffWriter, FarPatchesTakeNoSpace) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  Map map(header);
  map.layer({-1000, -1000}, 0, 7).at(0, {3, 4}) = 0.5f;
  map.layer({1000, 1000}, 0, 7).at(0, {5, 6}) = 0.5f;
  const testing::TempDir dir;
  testing::Collected findings;
  const Error error = testing::error_of([&] {
    map.layer({100'000, 1000}, 0, 7).at(0, {5, 6}) = 0.5f;
    write(geotiff(), map, dir / "a.tif");
  });
  EXPECT_EQ(error.code(), ErrorCode::kLimit);
  EXPECT_TRUE(std::filesystem::is_empty(dir / ""));
  map.extract({100'000, 1000}, 0);
  map.extract({1000, 1000}, 0);
  map.layer({-600, -600}, 0, 7).at(0, {5, 6}) = 0.5f;
  write(geotiff(), map, dir / "a.tif");  // 51328 x 51328 pixels
  EXPECT_LT(std::filesystem::file_size(dir / "a.tif"), 6u << 20);
  EXPECT_EQ(content_id(map), content_id(*open(geotiff(), dir / "a.tif")));
}

TEST(GeoTiffWriter, FailureLeavesNothingAndTheOldFile) {
  const Map map = test::random_map(8, one_layer(LayerType::occupancy(), 5));
  const testing::TempDir dir;
  testing::write_text(dir / "a.tif", "old");
  EXPECT_EQ(testing::error_of([&] { write(geotiff(), map, dir / "a.tif"); }).code(), ErrorCode::kOutput);
  const std::atomic<bool> cancel{true};
  WriteRequest request;
  request.path = dir / "a.tif";
  request.output.overwrite = true;
  request.run.cancel = &cancel;
  request.settings = {{"mode", "classes"}};
  EXPECT_EQ(testing::error_of([&] { geotiff().write(map, request); }).code(), ErrorCode::kCancelled);
  EXPECT_EQ(testing::read_text(dir / "a.tif"), "old");
  EXPECT_FALSE(std::filesystem::exists(dir / "a.tif.aux.xml"));
}

TEST(GeoTiffWriter, SideFileOfAnOldRasterIsNotKept) {
  const Map map = test::random_map(8, one_layer(LayerType::occupancy(), 5));
  const testing::TempDir dir;
  write(geotiff(), map, dir / "a.tif", {{"mode", "classes"}});
  EXPECT_TRUE(std::filesystem::exists(dir / "a.tif.aux.xml"));
  std::filesystem::remove(dir / "a.tif");
  EXPECT_THAT(testing::error_of([&] { write(geotiff(), map, dir / "a.tif"); }).message(),
              HasSubstr("a.tif.aux.xml' already exists"));
  write(geotiff(), map, dir / "a.tif", {}, nullptr, "", true);
  EXPECT_FALSE(std::filesystem::exists(dir / "a.tif.aux.xml"));
}

}  // namespace
}  // namespace apgm::converters
