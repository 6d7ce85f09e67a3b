#include <gtest/gtest.h>

#include "apgm/fuse/resample.hpp"
#include "layers.hpp"

namespace apgm {
namespace {

using test::Random;

const LayerType kSurface = LayerType::semantic("surface", {"Road", "Marking", "Blocked"});

Layer resampled(const Layer& in, const LayerType& type, int step) {
  Layer out;
  resample(in, type, step, out);
  return out;
}

Layer cells(int step, std::initializer_list<std::array<float, 4>> values) {
  Layer layer(kSurface, step);
  std::size_t i = 0;
  for (const auto& v : values) {
    for (int c = 0; c < 4; ++c) layer.plane(c)[i] = v[static_cast<std::size_t>(c)];
    ++i;
  }
  return layer;
}

void expect_cell(const Layer& layer, std::array<double, 4> want, double tolerance) {
  for (int c = 0; c < 4; ++c)
    EXPECT_NEAR(layer.plane(c)[0], want[static_cast<std::size_t>(c)], tolerance) << c;
}

TEST(ResampleEvidence, MergeGivesTheReferenceValues) {
  const std::array<float, 4> road{.9f, 0, 0, .1f}, marking{0, .9f, 0, .1f};
  const Layer in = cells(1, {road, road, road, marking});
  expect_cell(resampled(in, kSurface, 0), {.750 * (1 - 1e-4), .250 * (1 - 1e-4), 0, 1e-4}, 1e-6);
  LayerType mean = kSurface;
  mean.policy = Policy::kMean;
  expect_cell(resampled(in, mean, 0), {.675, .225, 0, .1}, 1e-6);
}

TEST(ResampleEvidence, SplitGivesTheReferenceValues) {
  const Layer out = resampled(cells(0, {{.6f, .2f, .1f, .1f}}), kSurface, 1);
  expect_cell(out, {.291773, .097257, .048629, .562341}, 1e-6);
}

TEST(ResampleEvidence, TwoLevelsAtOnceEqualOneByOne) {
  Random random(51);
  for (int round = 0; round < 20; ++round) {
    const Layer in = test::random_semantic(kSurface, 4, random);
    const Layer by_levels = resampled(resampled(in, kSurface, 3), kSurface, 2);
    EXPECT_LE(test::difference(by_levels, resampled(in, kSurface, 2)), 1e-5f);
  }
}

TEST(ResampleEvidence, MergeAfterSplitIsTheIdentity) {
  Random random(52);
  const Layer in = test::random_semantic(kSurface, 3, random);
  for (int step = 4; step <= 7; ++step) {
    EXPECT_LE(test::difference(in, resampled(resampled(in, kSurface, step), kSurface, 3)), 2e-6f) << step;
  }
}

TEST(ResampleEvidence, KeepsMassesValid) {
  Random random(53);
  for (const int step : {0, 1, 2, 5, 7}) {
    Layer out = resampled(test::random_semantic(kSurface, 4, random), kSurface, step);
    EXPECT_NO_THROW(canonicalise(out, kSurface));
  }
}

TEST(ResampleEvidence, TinyMassesAddUp) {
  const std::array<float, 4> tiny{1e-12f, 0, 3e-12f, 1};
  const Layer out = resampled(cells(1, {tiny, tiny, tiny, tiny}), kSurface, 0);
  EXPECT_NEAR(out.plane(0)[0] / 4e-12, 1, 1e-5);
  EXPECT_NEAR(out.plane(2)[0] / 12e-12, 1, 1e-5);
  EXPECT_NEAR(resampled(out, kSurface, 1).plane(0)[0] / 1e-12, 1, 1e-5);
}

TEST(ResampleEvidence, CertaintyStaysFinite) {
  const std::array<float, 4> certain{.25f, .75f, 0, 0}, none{0, 0, 0, 1};
  const Layer in = cells(1, {certain, none, none, none});
  expect_cell(resampled(in, kSurface, 0), {.25, .75, 0, 0}, 1e-6);
  expect_cell(resampled(cells(0, {certain}), kSurface, 2), {.25, .75, 0, 0}, 1e-6);
  const Layer both = resampled(cells(1, {certain, {1, 0, 0, 0}, none, none}), kSurface, 0);
  expect_cell(both, {.625, .375, 0, 0}, 1e-6);
}

TEST(ResampleEvidence, OneClassGivesThePapersFormulas) {
  // With all evidence for one class, it behaves as m(O) of the occupancy formulas.
  const Layer in = cells(1, {{.5f, 0, 0, .5f}, {.2f, 0, 0, .8f}, {0, 0, 0, 1}, {.9f, 0, 0, .1f}});
  expect_cell(resampled(in, kSurface, 0), {1 - .5 * .8 * .1, 0, 0, .5 * .8 * .1}, 1e-6);
  expect_cell(resampled(cells(0, {{.9f, 0, 0, .1f}}), kSurface, 1), {.437659, 0, 0, 1 - .437659}, 1e-6);
}

}  // namespace
}  // namespace apgm
