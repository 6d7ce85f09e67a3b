#include <filesystem>
#include <limits>

#include "tests/converters/geotiff_support.hpp"

namespace apgm::converters {
namespace {

using testing::collect;
using ::testing::ElementsAre;
using testing::error_of;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::open;
using testing::RasterSpec;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

class GeoTiffBadInput : public ::testing::Test {
 protected:
  Error refused(const RasterSpec& spec, const Settings& settings) {
    spec.save(dir_ / "a.tif");
    return error_of([&] { open(geotiff(), dir_ / "a.tif", settings); });
  }
  void expect(const Error& error, ErrorCode code, const std::string& message, const std::string& hint = "") {
    EXPECT_EQ(error.code(), code) << error.message();
    EXPECT_THAT(error.message(), HasSubstr(message));
    EXPECT_THAT(error.hint(), HasSubstr(hint));
  }
  RasterSpec plain(std::size_t bands = 1) const {
    RasterSpec spec;
    spec.bands.assign(bands, std::vector<double>(12, 0.25));
    return spec;
  }

  testing::TempDir dir_;
  const Settings as_value_{{"as", "value"}};
};

TEST_F(GeoTiffBadInput, WithoutCrsItMustBeSaid) {
  RasterSpec spec = plain();
  spec.epsg = 0;
  expect(refused(spec, as_value_), ErrorCode::kUnsupported, "has no coordinate reference system",
         "--set epsg=CODE");
  EXPECT_EQ(open(geotiff(), dir_ / "a.tif", {{"as", "value"}, {"epsg", "32633"}})->header().frame.epsg,
            32633);
  EXPECT_EQ(open(geotiff(), dir_ / "a.tif", {{"as", "value"}, {"allow_no_crs", "1"}})->header().frame.epsg,
            std::nullopt);
}

TEST_F(GeoTiffBadInput, DegreesAndFeetAreNoMetres) {
  RasterSpec spec = plain();
  spec.epsg = 4326;
  spec.transform = {9, 1e-4, 0, 48, 0, -1e-4};
  expect(refused(spec, as_value_), ErrorCode::kUnsupported, "'WGS 84', which is not in metres", "gdalwarp");
  spec.epsg = 2263;  // New York, feet
  expect(refused(spec, as_value_), ErrorCode::kUnsupported, "not in metres", "gdalwarp");
}

TEST_F(GeoTiffBadInput, AnotherCodeThanTheRasters) {
  plain().save(dir_ / "a.tif");
  testing::Collected findings;
  open(geotiff(), dir_ / "a.tif", {{"as", "value"}, {"epsg", "32633"}}, &findings);
  EXPECT_THAT(findings.of(Finding::Kind::kWarning),
              ElementsAre("epsg=32633 replaces the raster's EPSG:32632"));
}

TEST_F(GeoTiffBadInput, TurnedAndMirroredRasters) {
  RasterSpec spec = plain();
  spec.transform = {500000, 0.1, 0.01, 4000000, 0.01, -0.1};
  expect(refused(spec, as_value_), ErrorCode::kUnsupported, "turned, sheared or mirrored", "gdalwarp");
  spec.transform = {500000, -0.1, 0, 4000000, 0, -0.1};
  expect(refused(spec, as_value_), ErrorCode::kUnsupported, "turned, sheared or mirrored");
  spec.transform = {500000, kNan, 0, 4000000, 0, -0.1};
  expect(refused(spec, as_value_), ErrorCode::kUnsupported, "turned, sheared or mirrored");
}

TEST_F(GeoTiffBadInput, OblongPixels) {
  RasterSpec spec = plain();
  spec.transform = {500000, 0.1, 0, 4000000, 0, -0.2};
  expect(refused(spec, as_value_), ErrorCode::kUnsupported, "are not square: 0.1 x 0.2 m", "gdalwarp -tr");
  testing::Collected findings;
  open(geotiff(), dir_ / "a.tif", {{"as", "value"}, {"cell_m", "0.2"}}, &findings);
  EXPECT_THAT(findings.losses(),
              ElementsAre("pixels of 0.1 x 0.2 m are taken as squares of 0.2 m: they move by up to 0.2 m"));
}

TEST_F(GeoTiffBadInput, ValuesOfNoSaidMeaning) {
  expect(refused(plain(), {}), ErrorCode::kUnsupported, "does not say what its values mean", "as=masses");
  expect(refused(plain(), {{"as", "classes"}}), ErrorCode::kUnsupported, "holds no whole numbers");
  RasterSpec bytes = plain();
  bytes.type = GDT_Byte;
  expect(refused(bytes, {{"as", "classes"}}), ErrorCode::kUnsupported, "does not name its classes",
         "legend=FILE");
  expect(refused(plain(3), {{"as", "masses"}}), ErrorCode::kUnsupported,
         "does not name the hypotheses of its 3 bands", "channels=A,B");
  expect(refused(plain(17), as_value_), ErrorCode::kUnsupported, "17 bands");
  RasterSpec complex = plain();
  complex.type = GDT_CFloat32;
  expect(refused(complex, as_value_), ErrorCode::kUnsupported, "band 1 of");
}

TEST_F(GeoTiffBadInput, MassesAboveOneNameBandAndPixel) {
  RasterSpec spec = plain(2);
  spec.bands[1][6] = 1.5;
  const Settings masses{{"as", "masses"}};
  expect(refused(spec, masses), ErrorCode::kDamaged, "at column 2, row 1: band 2 is 1.5, no mass",
         "invalid=unknown");
  testing::Collected findings;
  const Map map =
      collect(*open(geotiff(), dir_ / "a.tif", {{"as", "masses"}, {"invalid", "unknown"}}, &findings));
  EXPECT_THAT(findings.losses(), ElementsAre("1 cells with invalid values become cells without data"));
  EXPECT_EQ(map.find({0, 0}, 0)->at(0, {2, 1}), 0.0f);
  EXPECT_EQ(map.find({0, 0}, 0)->at(0, {1, 1}), 0.25f);
  spec.bands[1][6] = -0.1;
  expect(refused(spec, masses), ErrorCode::kDamaged, "column 2, row 1: band 2 is -0.1");
  spec.bands[1][6] = kNan;
  expect(refused(spec, masses), ErrorCode::kDamaged,
         "column 2, row 1: band 2 has no data where other bands have");
  spec.bands[1][6] = 0.875;
  expect(refused(spec, masses), ErrorCode::kDamaged, "column 2, row 1: the masses sum to 1.125");
  spec.names = {"A", "Omega"};
  expect(refused(spec, {{"as", "masses"}, {"channels", "A,Omega"}}), ErrorCode::kInvalidArgument,
         "hypotheses");
}

TEST_F(GeoTiffBadInput, ProbabilitiesAndValuesOutOfRange) {
  RasterSpec spec = plain();
  spec.bands[0][0] = 1.25;
  expect(refused(spec, {{"as", "probability"}}), ErrorCode::kDamaged,
         "column 0, row 0: band 1 is 1.25, no probability in 0..1");
  spec.type = GDT_Float64;
  spec.bands[0][0] = 1e39;
  expect(refused(spec, as_value_), ErrorCode::kDamaged,
         "column 0, row 0: band 1 is 1e+39, no finite float32");
  spec.bands[0][0] = -std::numeric_limits<double>::infinity();
  expect(refused(spec, as_value_), ErrorCode::kDamaged, "band 1 is -inf");
}

TEST_F(GeoTiffBadInput, CodesTheLegendDoesNotName) {
  RasterSpec spec;
  spec.type = GDT_Int16;
  spec.bands = {{1, 2, 2, 2, -7, 1, 1, 1, 9, 9, 9, 1}};
  const std::string legend = testing::write_text(dir_ / "l.csv", "1,A\n2,B\n");
  expect(refused(spec, {{"legend", legend}}), ErrorCode::kDamaged,
         "band 1 is -7, which the legend does not name");
  testing::Collected findings;
  const Map map =
      collect(*open(geotiff(), dir_ / "a.tif", {{"legend", legend}, {"unknown_class", "B"}}, &findings));
  EXPECT_THAT(findings.losses(), ElementsAre("1 pixels of code -7, which the legend does not name, become B",
                                             "3 pixels of code 9, which the legend does not name, become B"));
  EXPECT_EQ(map.find({0, 0}, 0)->at(1, {0, 1}), 0.9f);
  const Map other =
      collect(*open(geotiff(), dir_ / "a.tif", {{"legend", legend}, {"unknown_class", "Omega"}}));
  EXPECT_EQ(other.find({0, 0}, 0)->at(2, {0, 1}), 1.0f);
  expect(error_of([&] {
           open(geotiff(), dir_ / "a.tif", {{"legend", legend}, {"unknown_class", "C"}});
         }),
         ErrorCode::kInvalidArgument, "unknown_class=C");
}

TEST_F(GeoTiffBadInput, Legends) {
  RasterSpec spec = plain();
  spec.type = GDT_Byte;
  spec.save(dir_ / "a.tif");
  const auto legend_error = [&](const std::string& name, const std::string& text) {
    const std::string path = testing::write_text(dir_ / name, text);
    return error_of([&] { open(geotiff(), dir_ / "a.tif", {{"legend", path}}); });
  };
  expect(legend_error("l.csv", "1,A\n1,B\n"), ErrorCode::kDamaged, "code 1 stands there twice");
  expect(legend_error("l.csv", "1,A\nx,B\n"), ErrorCode::kDamaged, "line 2: 'x' is no code");
  expect(legend_error("l.csv", "1,A\n2\n"), ErrorCode::kDamaged, "line 2 is not 'code,name'");
  expect(legend_error("l.csv", "1,A\n2,B,C\n"), ErrorCode::kDamaged, "line 2 is not 'code,name'");
  expect(legend_error("l.csv", "1,A\n2,\n"), ErrorCode::kDamaged, "line 2 has no name");
  expect(legend_error("l.csv", "1,A\n2,A\n"), ErrorCode::kDamaged, "fewer than two classes");
  expect(legend_error("l.csv", "1,A\n2,two words\n"), ErrorCode::kDamaged, "hypothesis name");
  expect(legend_error("l.csv", ""), ErrorCode::kDamaged, "fewer than two classes");
  expect(legend_error("l.yaml", "- 1\n"), ErrorCode::kDamaged, "no list of 'code: name'");
  expect(legend_error("l.yaml", "1: [A\n"), ErrorCode::kDamaged, "legend: line");
  expect(legend_error("l.yaml", "1: {a: b}\n"), ErrorCode::kDamaged, "no list");
  expect(legend_error("l.txt", "1,A\n2,B\n"), ErrorCode::kForeign, "neither .csv nor .yaml");
  std::string many;
  for (int i = 0; i < 20; ++i) many += std::to_string(i) + ",c" + std::to_string(i) + "\n";
  expect(legend_error("l.csv", many), ErrorCode::kLimit, "more than 15 classes");
  expect(error_of([&] {
           open(geotiff(), dir_ / "a.tif", {{"legend", dir_ / "gone.csv"}});
         }),
         ErrorCode::kUnreadable, "no such file");
}

TEST_F(GeoTiffBadInput, FilesThatAreNoRasters) {
  const auto of = [&](const std::string& path) { return error_of([&] { open(geotiff(), path); }); };
  expect(of(dir_ / "gone.tif"), ErrorCode::kUnreadable, "no such file");
  expect(of(dir_ / ""), ErrorCode::kUnreadable, "not a regular file");
  expect(of("/vsicurl/http://localhost/a.tif"), ErrorCode::kUnreadable, "no such file");
  expect(of(testing::write_text(dir_ / "a.tif", "II*")), ErrorCode::kForeign, "is no raster");
  plain().save(dir_ / "b.tif");
  const std::string vrt =
      "<VRTDataset rasterXSize=\"4\" "
      "rasterYSize=\"3\"><GeoTransform>0,1,0,0,0,-1</GeoTransform><VRTRasterBand "
      "dataType=\"Float32\" band=\"1\"><SimpleSource><SourceFilename>" +
      (dir_ / "b.tif") + "</SourceFilename></SimpleSource></VRTRasterBand></VRTDataset>";
  expect(of(testing::write_text(dir_ / "c.vrt", vrt)), ErrorCode::kForeign, "is no raster");
}

TEST_F(GeoTiffBadInput, MetadataThatDoesNotFit) {
  const Map map = test::random_map(2, testing::one_layer(LayerType::occupancy(), 4));
  testing::write(geotiff(), map, dir_ / "w.tif");
  const std::map<std::string, std::string> good{{"VERSION", "1"},
                                                {"CELLS", "masses"},
                                                {"LAYER", "occupancy"},
                                                {"HYPOTHESES", "O F"},
                                                {"CHANNELS", "O F"},
                                                {"POLICY", "conditional"},
                                                {"FRAME_ID", "map"},
                                                {"EPSG", "32632"},
                                                {"STEP", "7"},
                                                {"EDGE_UM", "12800000"},
                                                {"DATUM_UM", "500000000000 4000000000000"}};
  RasterSpec spec = plain(2);
  const auto with = [&](const std::string& key, const std::string& value) {
    spec.tags = good;
    if (value.empty())
      spec.tags.erase(key);
    else
      spec.tags[key] = value;
    return refused(spec, {});
  };
  expect(with("VERSION", "2"), ErrorCode::kUnsupported, "version 2");
  for (const auto& [key, value] : good) {
    if (key == "HYPOTHESES") continue;
    expect(with(key, ""), ErrorCode::kDamaged, "metadata item '" + key + "' of domain 'APGM' is missing");
  }
  expect(with("HYPOTHESES", ""), ErrorCode::kDamaged, "resampling policy");
  expect(with("STEP", "12"), ErrorCode::kDamaged, "'STEP'");
  expect(with("STEP", "7x"), ErrorCode::kDamaged, "is no whole number: '7x'");
  expect(with("EDGE_UM", "0"), ErrorCode::kDamaged, "domain 'APGM'");
  expect(with("DATUM_UM", "1"), ErrorCode::kDamaged, "does not hold 2 numbers");
  expect(with("EPSG", "-1"), ErrorCode::kDamaged, "'EPSG'");
  expect(with("POLICY", "best"), ErrorCode::kDamaged, "'POLICY'");
  expect(with("CHANNELS", "O"), ErrorCode::kDamaged, "domain 'APGM'");
  expect(with("STAMPS_NS", "1 2;"), ErrorCode::kDamaged, "'STAMPS_NS'");
  expect(with("CLASS_MASS", "2"), ErrorCode::kDamaged, "'CLASS_MASS'");
  spec.bands.pop_back();
  expect(with("STEP", "7"), ErrorCode::kDamaged, "has 1 bands, its metadata tells of 2");

  // Moved by half a cell, it is a raster of its own.
  spec = plain(2);
  spec.tags = good;
  spec.transform[0] += 0.05;
  spec.save(dir_ / "moved.tif");
  testing::Collected findings;
  const auto source = open(geotiff(), dir_ / "moved.tif", {}, &findings);
  EXPECT_THAT(findings.of(Finding::Kind::kNote), ElementsAre(HasSubstr("no longer lies on the grid")));
  EXPECT_EQ(source->header().frame.datum_x_um, 500'000'050'000);
}

TEST_F(GeoTiffBadInput, ABudgetBoundsTheCacheAndRefusesLargeBlocks) {
  const Map map = test::random_map(5, testing::one_layer(LayerType::occupancy(), 6));
  testing::write(geotiff(), map, dir_ / "a.tif");
  constexpr GIntBig kMiB = 1 << 20;
  const auto within = [&](std::uint64_t budget) { return geotiff().open({dir_ / "a.tif", {}, {}, budget}); };
  for (const GIntBig budget : {2 * kMiB, 1000 * kMiB}) {
    const auto source = within(static_cast<std::uint64_t>(budget));
    EXPECT_EQ(GDALGetCacheMax64(), std::min(budget / 4, 64 * kMiB));
    const auto another = within(0);
    EXPECT_EQ(GDALGetCacheMax64(), std::min(budget / 4, 64 * kMiB));
    EXPECT_EQ(testing::content_id(*source), testing::content_id(map));
  }
  EXPECT_EQ(GDALGetCacheMax64(), 64 * kMiB);
  // Tiles of 128 x 128 floats take 64 KiB, three times.
  EXPECT_EQ(testing::content_id(*within(192 << 10)), testing::content_id(map));
  expect(error_of([&] { within(191 << 10); }), ErrorCode::kLimit, "a block of band 1 of",
         "allow at least 1 MiB");
}

TEST_F(GeoTiffBadInput, DamagedFilesFailOrReadButNeverCrash) {
  auto options = testing::one_layer(LayerType::occupancy(), 6);
  options.range = {{0, 0}, {1, 1}};
  options.fill = 1;
  const Map map = test::random_map(4, options);
  testing::write(geotiff(), map, dir_ / "a.tif");
  const std::string whole = testing::read_text(dir_ / "a.tif");
  test::Random random(20);
  int errors = 0;
  for (int round = 0; round < 300; ++round) {
    std::string bytes = whole;
    if (round % 3 == 0) {
      bytes.resize(static_cast<std::size_t>(random.below(static_cast<int>(bytes.size()))));
    } else {
      // Half of the flips hit the directory and the tags, which lie at the start.
      const int end = round % 3 == 1 ? std::min<int>(2500, static_cast<int>(bytes.size()))
                                     : static_cast<int>(bytes.size());
      const auto at = static_cast<std::size_t>(random.below(end));
      bytes[at] = static_cast<char>(bytes[at] ^ (1 << random.below(8)));
    }
    testing::write_text(dir_ / "b.tif", bytes);
    try {
      const auto source = open(geotiff(), dir_ / "b.tif");
      if (source->summary().patches < 64) collect(*source, false);
    } catch (const Error& error) {
      EXPECT_NE(error.message(), "") << round;
      if (error.message().find("cannot be decoded") != std::string::npos) {
        EXPECT_THAT(error.hint(), HasSubstr("damaged"));
      }
      ++errors;
    }
  }
  EXPECT_GT(errors, 100);
}

TEST_F(GeoTiffBadInput, SettingsAreCheckedBeforeAFileIsOpened) {
  const auto reading = [&](const Settings& s) {
    return error_of([&] { geotiff().check_settings(s, Use::kReading); });
  };
  const auto writing = [&](const Settings& s) {
    return error_of([&] { geotiff().check_settings(s, Use::kWriting); });
  };
  for (const Settings& s :
       {Settings{{"as", "x"}}, Settings{{"band", "0"}}, Settings{{"band", "1.5"}},
        Settings{{"class_mass", "2"}}, Settings{{"invalid", "x"}}, Settings{{"policy", "x"}},
        Settings{{"cell_m", "-1"}}, Settings{{"allow_no_crs", "yes"}}, Settings{{"layer", "a b"}},
        Settings{{"mode", "masses"}}}) {
    EXPECT_EQ(reading(s).code(), ErrorCode::kInvalidArgument) << s.begin()->first;
  }
  for (const Settings& s :
       {Settings{{"mode", "x"}}, Settings{{"step", "12"}}, Settings{{"compression", "lzw"}},
        Settings{{"level", "20"}}, Settings{{"level", "10"}, {"compression", "deflate"}},
        Settings{{"level", "1"}, {"compression", "none"}}, Settings{{"as", "value"}}}) {
    EXPECT_EQ(writing(s).code(), ErrorCode::kInvalidArgument) << s.begin()->first;
  }
}

}  // namespace
}  // namespace apgm::converters
