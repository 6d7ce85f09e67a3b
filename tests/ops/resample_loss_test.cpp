#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "resampled.hpp"

namespace apgm {
namespace {

using namespace test;

const ResampleReport::OfType merge_four(const LayerType& type, const std::vector<std::vector<float>>& cells) {
  return resample_map(four_cells(type, cells), to_step(0)).report.types[0];
}

double lambda(const Map& map, TypeId type) {
  double sum = 0;
  for (const auto& [key, patch] : map.by_key()) {
    const auto it = patch.layers.find(type);
    if (it == patch.layers.end()) continue;
    for (const float o : it->second.plane(0)) sum += -std::log1p(-std::min(static_cast<double>(o), 1 - 1e-9));
  }
  return sum;
}

TEST(ResampleMap, ReportDoesNotDependOnThreads) {
  const Map map = every_type(11);
  const ResampleReport one = resample_map(map, to_step(2), threads(1)).report;
  for (const int n : {2, 4}) {
    const ResampleReport other = resample_map(map, to_step(2), threads(n)).report;
    ASSERT_EQ(other.types.size(), one.types.size());
    for (std::size_t t = 0; t < one.types.size(); ++t) {
      EXPECT_EQ(other.types[t].loss.sum, one.types[t].loss.sum);
      EXPECT_EQ(other.types[t].loss.most, one.types[t].loss.most);
      EXPECT_EQ(other.types[t].loss.known_cells, one.types[t].loss.known_cells);
      EXPECT_EQ(other.types[t].worst_patch, one.types[t].worst_patch);
      EXPECT_EQ(other.types[t].layers_merged, one.types[t].layers_merged);
    }
  }
}

TEST(ResampleMap, ThePlanForeseesTheCounts) {
  const Map map = random_map(3);
  const ResamplePlan plan(map, to_step(3));
  const ResampleReport report = resample_map(map, to_step(3)).report;
  std::uint64_t layers = 0;
  for (std::size_t t = 0; t < report.types.size(); ++t) {
    const auto &a = plan.expected().types[t], &b = report.types[t];
    EXPECT_EQ(a.layers_merged, b.layers_merged);
    EXPECT_EQ(a.layers_split, b.layers_split);
    EXPECT_EQ(a.layers_unchanged, b.layers_unchanged);
    EXPECT_EQ(a.cells_before, b.cells_before);
    EXPECT_EQ(a.cells_after, b.cells_after);
    const auto of_source = map.summary().types[t].layers;
    EXPECT_EQ(b.layers_merged + b.layers_split + b.layers_unchanged, of_source);
    EXPECT_EQ(b.cells_after, 64 * of_source);
    layers += of_source;
  }
  EXPECT_GT(layers, 0u);
}

TEST(ResampleMap, MergingAndSplittingConserveLambda) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    SCOPED_TRACE(seed);
    RandomMapOptions options;
    options.types = {LayerType::occupancy("a", Policy::kExclusive),
                     LayerType::occupancy("b", Policy::kConditional), LayerType::occupancy("c", Policy::kMin),
                     LayerType::occupancy("d", Policy::kProduct), LayerType::occupancy("e", Policy::kMedian)};
    options.min_step = 3;
    Map map = random_map(seed, options);
    // A certain cell has no finite lambda, and merged ones come near it: keep the sums where float32 has
    // digits.
    Map thin(map.header());
    for (const auto& [key, patch] : map.by_key()) {
      for (const auto& [id, layer] : patch.layers) {
        Layer& to = thin.layer(patch.index, id, layer.step());
        to = layer;
        for (float& o : to.plane(0)) o *= 0.01f;
      }
    }
    for (const int step : {2, 6}) {
      const Resampled out = resample_map(thin, to_step(step));
      for (TypeId id = 0; id < 5; ++id) {
        const double before = lambda(thin, id);
        EXPECT_NEAR(lambda(out.map, id), before, 1e-5 * before) << to_string(map.header().types[id].policy);
        EXPECT_GT(before, 0);
      }
    }
  }
}

TEST(ResampleMap, LossOfOccupancyByHand) {
  // Merged: O = .9, F = .1 * mean phi = .1 * .6 = .06; O - F = .84.
  const auto r = merge_four(LayerType::occupancy(), {{.9f, 0}, {0, .8f}, {0, .8f}, {0, .8f}});
  EXPECT_EQ(r.layers_merged, 1u);
  EXPECT_EQ(r.cells_before, 4u);
  EXPECT_EQ(r.cells_after, 1u);
  EXPECT_EQ(r.loss.known_cells, 4u);
  EXPECT_NEAR(r.loss.most, (.8 + .84) / 2, 1e-6);
  EXPECT_NEAR(r.loss.mean(), ((.9 - .84) / 2 + 3 * (.8 + .84) / 2) / 4, 1e-6);
  EXPECT_EQ(r.loss.obstacles, 0u);
  EXPECT_EQ(r.worst.mean(), r.loss.mean());
}

TEST(ResampleMap, LossCountsKnownCellsOnly) {
  const auto r = merge_four(LayerType::occupancy(), {{0, 1}, {0, 0}, {0, 0}, {0, 0}});
  EXPECT_EQ(r.loss.known_cells, 1u);
  EXPECT_NEAR(r.loss.mean(), (1 - .25) / 2, 1e-6);  // F = mean phi = .25
}

TEST(ResampleMap, EqualFreeCellsLoseNothing) {
  const auto r = merge_four(LayerType::occupancy(), {{0, .75f}, {0, .75f}, {0, .75f}, {0, .75f}});
  EXPECT_EQ(r.loss.known_cells, 4u);
  EXPECT_EQ(r.loss.most, 0);
  EXPECT_EQ(r.worst.sum, 0);
}

TEST(ResampleMap, LossOfSemanticsIsOverAllHypotheses) {
  // Means: a .5, b .25, Omega .25; BetP(a) = .5 + .25/2 = .625, BetP(b) = .375.
  const auto r = merge_four(LayerType::semantic("s", {"a", "b"}, Policy::kMean),
                            {{1, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}});
  EXPECT_EQ(r.loss.known_cells, 3u);
  EXPECT_NEAR(r.loss.most, .625, 1e-6);
  EXPECT_NEAR(r.loss.mean(), (2 * .375 + .625) / 3, 1e-6);
}

TEST(ResampleMap, LossOfNumbersIsInTheirUnit) {
  const float no = std::numeric_limits<float>::quiet_NaN();
  const auto r = merge_four(LayerType::real("h", {"x", "y"}), {{1, no}, {4, 2}, {no, no}, {no, 8}});
  EXPECT_EQ(r.loss.known_cells, 3u);  // x = 2.5, y = 5
  EXPECT_NEAR(r.loss.most, 3, 1e-6);
  EXPECT_NEAR(r.loss.mean(), (1.5 + 3 + 3) / 3, 1e-6);
  const auto counts = merge_four(LayerType::real("n", {"n"}, Policy::kSum), {{4}, {4}, {4}, {4}});
  EXPECT_EQ(counts.loss.known_cells, 4u);
  EXPECT_EQ(counts.loss.most, 0);  // 16, shared evenly
}

TEST(ResampleMap, DempsterLosesAnObstacleAndOurPoliciesDoNot) {
  const std::vector<std::vector<float>> cells{{.9f, 0}, {0, .9f}, {0, .9f}, {0, .9f}};
  for (const Policy policy :
       {Policy::kExclusive, Policy::kConditional, Policy::kMin, Policy::kProduct, Policy::kMedian}) {
    EXPECT_EQ(merge_four(LayerType::occupancy("o", policy), cells).loss.obstacles, 0u) << to_string(policy);
  }
  for (const Policy policy : {Policy::kDempster, Policy::kMean}) {
    EXPECT_EQ(merge_four(LayerType::occupancy("o", policy), cells).loss.obstacles, 1u) << to_string(policy);
  }
  // Weak evidence among strong free space: conditional and median promise nothing below m(O) = .5.
  const std::vector<std::vector<float>> weak{{.3f, .1f}, {0, .9f}, {0, .9f}, {0, .9f}};
  for (const Policy policy : {Policy::kExclusive, Policy::kMin, Policy::kProduct}) {
    EXPECT_EQ(merge_four(LayerType::occupancy("o", policy), weak).loss.obstacles, 0u) << to_string(policy);
  }
  EXPECT_EQ(merge_four(LayerType::occupancy("o", Policy::kConditional), weak).loss.obstacles, 1u);
}

TEST(ResampleMap, NoObstacleOfRandomMapsVanishesByMerging) {
  std::uint64_t dempster = 0, known = 0;
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    SCOPED_TRACE(seed);
    const Map map = every_type(seed);
    for (const int step : {0, 1, 3}) {
      resample_map(map, to_step(step), {}, [&](const ResampledLayer& layer) {
        const Policy policy = map.header().types[layer.type].policy;
        if (*layer.to > layer.from) return;
        if (policy == Policy::kDempster) dempster += layer.loss.obstacles;
        if (policy != Policy::kExclusive && policy != Policy::kMin && policy != Policy::kProduct) return;
        EXPECT_EQ(layer.loss.obstacles, 0u) << to_string(policy);
        known += layer.loss.known_cells;
      });
    }
  }
  EXPECT_GT(known, 10'000u);
  EXPECT_GT(dempster, 0u);
}

TEST(ResampleMap, SplittingCountsObstaclesAndNoLoss) {
  // (.6, .3): lambda / 4 leaves O = .2047 beside F = .75 (1 - O).
  const Map map = four_cells(LayerType::occupancy(), {{.6f, .3f}, {.6f, 0}, {0, .5f}, {0, 0}});
  const auto r = resample_map(map, to_step(2)).report.types[0];
  EXPECT_EQ(r.layers_split, 1u);
  EXPECT_EQ(r.loss.known_cells, 0u);
  EXPECT_EQ(r.loss.obstacles, 1u);
}

TEST(ResampleMap, LayersThatComeOutWithoutDataAreCounted) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy("a", Policy::kMin), LayerType::occupancy("b")});
  Map map(header);
  map.layer({0, 0}, 0, 1).at(1, {0, 0}) = 0.9f;  // free, among unknown: nothing
  map.layer({1, 0}, 0, 1).at(1, {0, 0}) = 0.9f;
  map.layer({1, 0}, 1, 1).at(0, {0, 0}) = 0.9f;
  map.layer({2, 0}, 0, 1).at(0, {0, 0}) = 0.9f;
  std::vector<bool> emptied;
  const Resampled out = resample_map(map, to_step(0), threads(2),
                                     [&](const ResampledLayer& layer) { emptied.push_back(layer.emptied); });
  EXPECT_EQ(emptied, (std::vector<bool>{true, true, false, false}));
  EXPECT_EQ(out.report.types[0].layers_merged, 3u);
  EXPECT_EQ(out.report.types[0].layers_emptied, 2u);
  EXPECT_EQ(out.report.types[0].cells_after, 1u);
  EXPECT_EQ(out.report.types[1].layers_emptied, 0u);
  EXPECT_EQ(out.report.patches_dropped, 0u);
  EXPECT_EQ(out.report.patches_emptied, 1u);
  EXPECT_EQ(out.map.size(), 2u);
}

}  // namespace
}  // namespace apgm
