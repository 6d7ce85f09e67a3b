#include <algorithm>
#include <cmath>
#include <limits>

#include "apgm/ops/resample_map.hpp"
#include "tests/converters/geotiff_support.hpp"

namespace apgm::converters {
namespace {

using testing::collect;
using testing::content_id;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::open;
using testing::RasterSpec;
using testing::write;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// Values of a channel of the only layer, the northern row first, of a raster that was read with its
/// south-west corner as datum.
std::vector<float> values(const Map& map, int channel, int width = 4, int height = 3, int step = 7) {
  std::vector<float> list;
  const Layer& layer = *map.find({0, 0}, 0);
  EXPECT_EQ(layer.step(), step);
  for (int b = height - 1; b >= 0; --b) {
    for (int a = 0; a < width; ++a) list.push_back(layer.at(channel, {a, b}));
  }
  return list;
}

TEST(GeoTiffReader, ProbabilitiesBecomeLeastCommittedBeliefs) {
  const testing::TempDir dir;
  RasterSpec spec;
  spec.bands = {{0.5, 0.75, 0.25, 1, 0, -9999, kNan, 0.5, 0.5, 0.5, 0.5, 0.875}};
  spec.no_data = -9999;
  testing::Collected findings;
  const Map map = collect(*open(geotiff(), spec.save(dir / "a.tif"), {{"as", "probability"}}, &findings));
  EXPECT_THAT(findings.list, ElementsAre(::testing::Field(
                                 &Finding::text, "5 cells of probability 0.5 become cells without data")));
  EXPECT_THAT(values(map, 0), ElementsAre(0, 0.5f, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0.75f));
  EXPECT_THAT(values(map, 1), ElementsAre(0, 0, 0.5f, 0, 1, 0, 0, 0, 0, 0, 0, 0));
  EXPECT_EQ(map.header().types[0], LayerType::occupancy());
  EXPECT_EQ(map.header().frame.epsg, 32632);
  EXPECT_EQ(map.header().frame.edge_um, 12'800'000);
  EXPECT_NEAR(map.header().frame.datum_m().y_m, 4000000 - 0.3, 1e-9);
}

TEST(GeoTiffReader, ValuesKeepTheirBandsNamesAndHoles) {
  const testing::TempDir dir;
  RasterSpec spec;
  spec.type = GDT_Float64;
  spec.bands = {{1, 2, 3, 4, kNan, 6, 7, 8, 9, 10, 11, 12},
                {kNan, -2, 0, 1e30, kNan, 0.1, 7, 8, 9, 10, 11, 12}};
  spec.names = {"z", "not a name"};
  testing::Collected findings;
  const Map map = collect(*open(geotiff(), spec.save(dir / "a.tif"),
                                {{"as", "value"}, {"layer", "height"}, {"policy", "maximum"}}, &findings));
  EXPECT_THAT(findings.losses(), ElementsAre("2 cells hold values that are rounded to float32"));
  EXPECT_EQ(map.header().types[0], LayerType::real("height", {"z", "band_2"}, Policy::kMaximum));
  EXPECT_TRUE(std::isnan(map.find({0, 0}, 0)->at(1, {0, 2})));
  EXPECT_TRUE(std::isnan(map.find({0, 0}, 0)->at(0, {0, 1})));
  EXPECT_EQ(map.find({0, 0}, 0)->at(0, {0, 2}), 1.0f);
  EXPECT_EQ(map.find({0, 0}, 0)->at(1, {1, 1}), 0.1f);
  const Map one =
      collect(*open(geotiff(), dir / "a.tif", {{"as", "value"}, {"band", "1"}, {"channels", "top"}}));
  EXPECT_EQ(one.header().types[0], LayerType::real("value", {"top"}));
}

TEST(GeoTiffReader, SouthUpRastersAreTurnedOver) {
  const testing::TempDir dir;
  RasterSpec spec;
  spec.bands = {{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}};
  spec.transform = {500000, 0.1, 0, 4000000, 0, 0.1};
  const Map map = collect(*open(geotiff(), spec.save(dir / "a.tif"), {{"as", "value"}}));
  EXPECT_THAT(values(map, 0), ElementsAre(9, 10, 11, 12, 5, 6, 7, 8, 1, 2, 3, 4));
  EXPECT_EQ(map.header().frame.datum_m(), (Point{500000, 4000000}));
}

TEST(GeoTiffReader, CodesBecomeTheClassesOfALegend) {
  const testing::TempDir dir;
  RasterSpec spec;
  spec.type = GDT_Byte;
  spec.no_data = 255;
  spec.bands = {{11, 21, 22, 0, 255, 11, 11, 11, 11, 11, 11, 11}};
  spec.save(dir / "a.tif");
  testing::write_text(dir / "a.csv", "code,name\r\n# comment\n11,Water\n21, Town\n22,Town\n0,Omega\n");
  testing::write_text(dir / "a.yaml", "11: Water\n21: Town\n22: Town\n0: Omega\n");
  testing::Collected findings;
  const Map map = collect(
      *open(geotiff(), dir / "a.tif", {{"legend", dir / "a.csv"}, {"class_mass", "0.75"}}, &findings));
  EXPECT_THAT(findings.list, IsEmpty());
  EXPECT_EQ(map.header().types[0], LayerType::semantic("semantic", {"Water", "Town"}, Policy::kMean));
  EXPECT_THAT(values(map, 0), ElementsAre(.75f, 0, 0, 0, 0, .75f, .75f, .75f, .75f, .75f, .75f, .75f));
  EXPECT_THAT(values(map, 1), ElementsAre(0, .75f, .75f, 0, 0, 0, 0, 0, 0, 0, 0, 0));
  EXPECT_THAT(values(map, 2), ElementsAre(.25f, .25f, .25f, 1, 1, .25f, .25f, .25f, .25f, .25f, .25f, .25f));
  const auto yaml = open(geotiff(), dir / "a.tif", {{"legend", dir / "a.yaml"}, {"class_mass", "0.75"}});
  EXPECT_EQ(content_id(map), content_id(*yaml));
}

TEST(GeoTiffReader, NamesOfTheRasterAreItsLegend) {
  const testing::TempDir dir;
  RasterSpec spec;
  spec.type = GDT_Byte;
  spec.bands = {{1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 3}};
  spec.save(dir / "a.tif");
  testing::write_text(dir / "a.tif.aux.xml",
                      "<PAMDataset><PAMRasterBand band=\"1\"><CategoryNames><Category></Category>"
                      "<Category>Open Water</Category><Category></Category><Category>Sand</Category>"
                      "</CategoryNames></PAMRasterBand></PAMDataset>");
  testing::Collected findings;
  const Map map = collect(*open(geotiff(), dir / "a.tif", {}, &findings));
  EXPECT_THAT(map.header().types[0].hypotheses, ElementsAre("Open_Water", "Sand"));
  EXPECT_THAT(findings.of(Finding::Kind::kNote), ElementsAre("class 'Open Water' is called 'Open_Water'"));
  EXPECT_THAT(findings.losses(), IsEmpty());
  EXPECT_THAT(geotiff().files_read(dir / "a.tif"), ElementsAre(dir / "a.tif", dir / "a.tif.aux.xml"));
}

TEST(GeoTiffReader, MassesOfAForeignRaster) {
  const testing::TempDir dir;
  RasterSpec spec;
  spec.bands = {{.5, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, {.25, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1}};
  const Map map = collect(*open(geotiff(), spec.save(dir / "a.tif"), {{"as", "masses"}}));
  EXPECT_EQ(map.header().types[0], LayerType::occupancy());
  EXPECT_EQ(values(map, 0)[0], .5f);
  EXPECT_EQ(values(map, 1)[11], 1.0f);
  const Map named = collect(
      *open(geotiff(), dir / "a.tif", {{"as", "masses"}, {"channels", "dry,wet"}, {"layer", "rain"}}));
  EXPECT_THAT(named.header().types[0].hypotheses, ElementsAre("dry", "wet"));
  EXPECT_EQ(named.header().types[0].name, "rain");
}

TEST(GeoTiffReader, ReadsOtherRasters) {
  const testing::TempDir dir;
  testing::write_text(
      dir / "a.asc",
      "ncols 2\nnrows 2\nxllcorner 100\nyllcorner 200\ncellsize 0.5\nNODATA_value -1\n1 2\n-1 4\n");
  const std::string head = "ncols 2\n";
  EXPECT_TRUE(geotiff().sniffs("a.asc", std::as_bytes(std::span(head))));
  const Map map = collect(*open(geotiff(), dir / "a.asc", {{"as", "value"}, {"epsg", "25832"}}));
  EXPECT_EQ(map.header().frame.epsg, 25832);
  const Layer& layer = *map.find({0, 0}, 0);
  EXPECT_EQ(layer.at(0, {0, 1}), 1.0f);
  EXPECT_TRUE(std::isnan(layer.at(0, {0, 0})));
  EXPECT_EQ(layer.at(0, {1, 0}), 4.0f);
}

TEST(GeoTiffReader, LargeCellsGetLargePatches) {
  const testing::TempDir dir;
  RasterSpec spec;
  spec.bands = {std::vector<double>(12, 1.0)};
  spec.transform = {500000, 30, 0, 4000000, 0, -30};
  const auto source = open(geotiff(), spec.save(dir / "a.tif"), {{"as", "value"}});
  EXPECT_EQ(source->header().frame.edge_um, 3'840'000'000);
  EXPECT_EQ(source->summary().patches, 1u);
}

/// Pixels of each class, from a map: by the class with the greatest mass.
std::vector<std::uint64_t> counts(const PatchSource& source, std::size_t classes) {
  std::vector<std::uint64_t> n(classes);
  const Map map = collect(source);
  for (const auto& [key, patch] : map.by_key()) {
    const Layer& layer = patch.layers.at(0);
    for (std::size_t i = 0; i < layer.cells(); ++i) {
      std::size_t best = 0;
      for (std::size_t k = 1; k < classes; ++k) {
        if (layer.plane(static_cast<int>(k))[i] > layer.plane(static_cast<int>(best))[i]) best = k;
      }
      n[best] += layer.plane(static_cast<int>(best))[i] > 0;
    }
  }
  return n;
}

/// Mass of each class times area, summed over a map.
std::vector<double> shares(const PatchSource& source, std::size_t classes) {
  std::vector<double> sums(classes);
  const Map map = collect(source);
  for (const auto& [key, patch] : map.by_key()) {
    const Layer& layer = patch.layers.at(0);
    const double area = std::pow(map.header().frame.cell_m(layer.step()), 2);
    for (std::size_t k = 0; k < classes; ++k) {
      for (const float v : layer.plane(static_cast<int>(k))) sums[k] += static_cast<double>(v) * area;
    }
  }
  return sums;
}

TEST(GeoTiffReader, LandCoverKeepsItsClassShares) {
  const std::string path = testing::real_data("geotiff/nlcd.tif");
  if (path.empty()) GTEST_SKIP() << "geotiff/nlcd.tif is not there";
  // As a histogram of the file by GDAL says.
  const std::vector<std::uint64_t> expected{1209, 17517, 106070, 767537, 545771, 4878, 8728, 6497};
  const testing::TempDir dir;
  std::string legend;
  for (int code = 1; code <= 8; ++code)
    legend += std::to_string(code) + ",class_" + std::to_string(code) + "\n";
  testing::write_text(dir / "nlcd.csv", legend);
  testing::Collected findings;
  const auto source = open(geotiff(), path, {{"legend", dir / "nlcd.csv"}, {"cell_m", "31.5275"}}, &findings);
  EXPECT_THAT(findings.losses(), ElementsAre(HasSubstr("they move by up to 1.931 m")));
  EXPECT_EQ(source->header().frame.epsg, 26912);
  EXPECT_EQ(counts(*source, 8), expected);

  testing::Collected none;
  write(geotiff(), *source, dir / "a.tif", {{"mode", "classes"}}, &none);
  EXPECT_THAT(none.losses(), IsEmpty());
  const auto again = open(geotiff(), dir / "a.tif");
  EXPECT_EQ(counts(*again, 8), expected);
  EXPECT_EQ(content_id(*again), content_id(*source));

  const Map map = collect(*source);
  ResampleOptions options;
  options.step = 4;
  const ResamplePlan plan(map, options);
  Map coarse(plan.header());
  MapSink sink(coarse);
  plan.run(sink);
  EXPECT_EQ(coarse.header().types[0].policy, Policy::kMean);
  const auto before = shares(map, 8), after = shares(coarse, 8);
  const double all = 1359.0 * 1073 * 31.5275 * 31.5275;
  for (std::size_t k = 0; k < 8; ++k) {
    EXPECT_NEAR(after[k], before[k], 1e-6 * all) << k;
    EXPECT_NEAR(before[k], static_cast<double>(expected[k]) * 0.9 * 31.5275 * 31.5275, 1e-6 * all) << k;
  }
  write(geotiff(), coarse, dir / "coarse.tif");
  EXPECT_EQ(content_id(coarse), content_id(*open(geotiff(), dir / "coarse.tif")));
}

}  // namespace
}  // namespace apgm::converters
