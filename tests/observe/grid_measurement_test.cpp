#include <gtest/gtest.h>

#include <map>

#include "apgm/fuse/resample.hpp"
#include "apgm/observe/model.hpp"
#include "scans.hpp"

namespace apgm {
namespace {

using test::always;
using test::frame_of_8_m;
using test::image_of;
using test::models_of;
using test::Random;
using test::random_scan;
using test::uniform;

// The grid measurement model (paper, Eq. evidence) and Eq. (merge): where the relevance of a point does not
// depend on the cell, merging equals measuring with the larger cells.
class GridMeasurementModelTest : public ::testing::Test {
 protected:
  /// Both layers of a patch at `step - 1`: merged from `step`, and measured.
  struct Both {
    Layer merged, measured;
  };
  std::vector<Both> both(const Models& models, const RangeScan& scan, int step) {
    Observer fine(frame_, models), coarse(frame_, models);
    const auto f = fine.observe(scan, always(step)), c = coarse.observe(scan, always(step - 1));
    std::map<PatchIndex, Both> by_patch;
    for (const ObservedLayer& layer : f) {
      resample(layer.cells, models.occupancy_type(), step - 1, by_patch[layer.patch].merged);
    }
    for (const ObservedLayer& layer : c) by_patch[layer.patch].measured = layer.cells;
    std::vector<Both> result;
    for (auto& [patch, pair] : by_patch) {
      EXPECT_EQ(pair.merged.step(), pair.measured.step()) << "seen at one step only";
      result.push_back(std::move(pair));
    }
    return result;
  }
  Frame frame_ = frame_of_8_m();
};

TEST_F(GridMeasurementModelTest, MergedOccupancyEqualsMeasuringAtTheCoarserStep) {
  Models models;
  models.nuss.sigma_m = 10'000;  // every return has the relevance occ_max in every cell
  models.nuss.occ_max = 0.3;
  Random random(7);
  std::size_t occupied = 0, free = 0;
  for (int i = 0; i < 40; ++i) {
    const int step = 2 + i % 5;
    for (const Both& b : both(models, random_scan(random, 300, 10, 1.0), step)) {
      for (std::size_t k = 0; k < b.measured.cells(); ++k) {
        const float o = b.measured.plane(0)[k], f = b.measured.plane(1)[k], f_merged = b.merged.plane(1)[k];
        ASSERT_NEAR(b.merged.plane(0)[k], o, 1e-6);
        // Free space is an average over the merged cells, of which a beam need not cross all.
        ASSERT_EQ(f_merged > 0, f > 0);
        ASSERT_LE(f_merged, f + 1e-6f);
        occupied += o > 0;
        free += f > 0;
      }
    }
  }
  EXPECT_GT(occupied, 5'000u);
  EXPECT_GT(free, 5'000u);
}

TEST_F(GridMeasurementModelTest, MergedOccupancyEqualsMeasuringForReturnsWithoutPassages) {
  // Richter: relevance 1 - p_fp in every cell; passages count per cell and do not merge.
  const Models models = models_of(ModelKind::kRichter);
  Random random(8);
  std::size_t compared = 0;
  for (int i = 0; i < 40; ++i) {
    RangeScan scan = random_scan(random, 300, 10, 1.0);
    for (auto& beam : scan.beams) beam.from = beam.to;
    for (const Both& b : both(models, scan, 2 + i % 5)) {
      for (std::size_t k = 0; k < b.measured.cells(); ++k) {
        ASSERT_NEAR(b.merged.plane(0)[k], b.measured.plane(0)[k], 1e-6);
        compared += b.measured.plane(0)[k] > 0;
      }
    }
  }
  EXPECT_GT(compared, 5'000u);
}

TEST_F(GridMeasurementModelTest, PixelsOfMergedCellsEqualPixelsOfTheLargerCell) {
  Observer fine(frame_of_8_m(), {}), coarse(frame_of_8_m(), {});
  Random random(9);
  std::vector<LabelledGround::Pixel> pixels;
  for (int i = 0; i < 20'000; ++i) {
    pixels.push_back(
        {{uniform(random, 0, 8), uniform(random, 0, 8)}, static_cast<std::uint8_t>(random() % 3)});
  }
  const auto f = fine.observe(image_of(pixels), always(5)), c = coarse.observe(image_of(pixels), always(3));
  Layer merged;
  resample(f[0].cells, fine.models().semantic_type(), 3, merged);
  for (int k = 0; k < 4; ++k) {
    for (std::size_t i = 0; i < merged.cells(); ++i)
      ASSERT_NEAR(merged.plane(k)[i], c[0].cells.plane(k)[i], 2e-6);
  }
}

}  // namespace
}  // namespace apgm
