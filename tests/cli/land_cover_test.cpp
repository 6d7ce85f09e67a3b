#include <cstdlib>

#include "apgm/format/reader.hpp"
#include "cli_test.hpp"

namespace apgm::test {
namespace {

/// A real raster of land cover: 1073 x 1359 pixels of 8 classes.
class LandCoverTest : public CliTest {
 protected:
  static constexpr std::array<std::uint64_t, 8> kPixels{1209,    17'517, 106'070, 767'537,
                                                        545'771, 4878,   8728,    6497};

  void SetUp() override {
    const char* dir = std::getenv("APGM_REAL_DATA");
    raster_ = std::string(dir != nullptr ? dir : APGM_SOURCE_DIR "/../shared/data") + "/geotiff/nlcd.tif";
    if (!std::filesystem::exists(raster_)) GTEST_SKIP() << "no raster geotiff/nlcd.tif";
    raster_ = std::filesystem::canonical(raster_);
    std::string legend = "code,name\n";
    for (std::size_t k = 0; k < kPixels.size(); ++k) {
      legend += std::to_string(k + 1) + ",class_" + std::to_string(k + 1) + "\n";
    }
    put("legend.csv", legend);
    const Outcome read = tool(
        "convert", {raster_, "--set", "legend=legend.csv", "--set", "cell_m=31.5275", "-o", "cover.apgm"});
    if (read.err.find("is of no format") != std::string::npos) GTEST_SKIP() << "no GeoTIFF in this build";
    // Pixels that are not square are taken as squares: a loss that is told.
    ASSERT_EQ(read.code, 3) << read.err;
    EXPECT_THAT(read.err, HasSubstr("are taken as squares of 31.5275 m"));
  }

  struct Shares {
    std::array<std::uint64_t, 8> cells{};  ///< by class: cells with mass for it alone
    std::array<double, 8> area_m2{};       ///< by class: masses times area
  };
  Shares shares(const std::string& name) const {
    const Reader map(path(name));
    Shares shares;
    const auto cursor = map.patches();
    PatchInfo patch;
    Layer layer;
    while (cursor->next(patch)) {
      for (const LayerInfo& info : patch.layers) {
        map.load(info, layer);
        const double cell_m = map.header().frame.cell_m(layer.step());
        const LayerType& type = map.header().types[info.type];
        for (std::size_t i = 0; i < layer.cells(); ++i) {
          std::size_t classes = 0, last = 0;
          for (std::size_t k = 0; k < kPixels.size(); ++k) {
            EXPECT_EQ(type.hypotheses[k], "class_" + std::to_string(k + 1));
            const float mass = layer.plane(static_cast<int>(k))[i];
            shares.area_m2[k] += static_cast<double>(mass) * cell_m * cell_m;
            if (mass > 0) last = k;
            classes += mass > 0;
          }
          if (classes == 1) ++shares.cells[last];
        }
      }
    }
    return shares;
  }

  std::string raster_;
};

TEST_F(LandCoverTest, ClassesSurviveTheMapAndTheWayBack) {
  EXPECT_EQ(shares("cover.apgm").cells, kPixels);
  const Outcome written = tool("convert", {"cover.apgm", "--set", "mode=classes", "-o", "cover.tif"});
  EXPECT_EQ(written.code, 0) << written.err;
  const Outcome read = tool("convert", {"cover.tif", "-o", "again.apgm"});
  EXPECT_EQ(read.code, 0) << read.err;
  EXPECT_EQ(shares("again.apgm").cells, kPixels);
  EXPECT_EQ(info("again.apgm")["content_id"], info("cover.apgm")["content_id"]);
}

TEST_F(LandCoverTest, MeansConserveTheShares) {
  const Shares fine = shares("cover.apgm");
  for (const char* cell_m : {"63.055", "252.22"}) {
    const Outcome merged = tool(
        "resample", {"cover.apgm", "--resolution", cell_m, "--policy", "mean", "-O", "-o", "coarse.apgm"});
    EXPECT_EQ(merged.code, 0) << merged.err;
    const Shares coarse = shares("coarse.apgm");
    for (std::size_t k = 0; k < kPixels.size(); ++k) {
      EXPECT_NEAR(coarse.area_m2[k], fine.area_m2[k], 1e-6 * fine.area_m2[k]) << "class " << k + 1;
    }
  }
}

}  // namespace
}  // namespace apgm::test
