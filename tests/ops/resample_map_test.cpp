#include "apgm/ops/resample_map.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "apgm/fuse/regrid.hpp"
#include "apgm/fuse/resample.hpp"
#include "random_map.hpp"
#include "stored_map.hpp"

namespace apgm {
namespace {

using test::difference;
using test::random_map;
using test::RandomMapOptions;

struct Resampled {
  Map map;
  ResampleReport report;
};

Resampled resample_map(const PatchSource& source, const ResampleOptions& options, const RunOptions& run = {},
                       const std::function<void(const ResampledLayer&)>& watch = {}) {
  const ResamplePlan plan(source, options);
  Map map(plan.header());
  test::StoredSink sink(map);
  const ResampleReport report = plan.run(sink, run, watch);
  return {std::move(map), report};
}

ResampleOptions to_step(int step) {
  ResampleOptions options;
  options.step = step;
  return options;
}

RunOptions threads(int n) {
  RunOptions run;
  run.threads = n;
  return run;
}

Error failure(const PatchSource& source, const ResampleOptions& options) {
  try {
    resample_map(source, options);
  } catch (const Error& error) {
    return error;
  }
  return {ErrorCode::kCancelled, "no failure"};
}

/// Types of every policy.
std::vector<LayerType> all_types() {
  std::vector<LayerType> types;
  for (const Policy policy : {Policy::kExclusive, Policy::kConditional, Policy::kMin, Policy::kProduct,
                              Policy::kMedian, Policy::kDempster, Policy::kMean}) {
    types.push_back(LayerType::occupancy("occ_" + std::string(to_string(policy)), policy));
  }
  for (const Policy policy : {Policy::kEvidence, Policy::kMean}) {
    types.push_back(LayerType::semantic("sem_" + std::string(to_string(policy)), {"a", "b", "c"}, policy));
  }
  for (const Policy policy : {Policy::kMean, Policy::kSum, Policy::kMinimum, Policy::kMaximum}) {
    types.push_back(LayerType::real("real_" + std::string(to_string(policy)), {"x", "y"}, policy));
  }
  return types;
}

Map every_type(std::uint64_t seed) {
  RandomMapOptions options;
  options.types = all_types();
  options.range = {{-2, -2}, {1, 1}};
  return random_map(seed, options);
}

/// One patch (0,0) with one layer of `type` at step 1: cells (0,0), (1,0), (0,1), (1,1).
Map four_cells(const LayerType& type, const std::vector<std::vector<float>>& cells) {
  MapHeader header;
  header.types = TypeTable({type});
  Map map(header);
  Layer& layer = map.layer({0, 0}, 0, 1);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    for (std::size_t c = 0; c < cells[i].size(); ++c) layer.plane(static_cast<int>(c))[i] = cells[i][c];
  }
  return map;
}

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

TEST(ResampleMap, GivesTheCellsOfResampleForEveryTypeAndPolicy) {
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    SCOPED_TRACE(seed);
    const Map map = every_type(seed);
    for (const int step : {0, 2, 6}) {
      SCOPED_TRACE(step);
      Map expected(map.header());
      for (const auto& [key, patch] : map.by_key()) {
        for (const auto& [id, layer] : patch.layers) {
          resample(layer, map.header().types[id], step, expected.layer(patch.index, id, step));
        }
      }
      expected.prune();
      for (const int n : {1, 2}) {
        EXPECT_EQ(difference(resample_map(map, to_step(step), threads(n)).map, expected, true), "");
      }
    }
  }
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

TEST(ResampleMap, PassesLayersThatHaveTheStepAsStored) {
  const Map map = random_map(5);
  const test::StoredSource source(map);
  const ResampleReport report = resample_map(source, to_step(3)).report;
  std::uint64_t unchanged = 0, changed = 0;
  for (const auto& type : report.types) {
    unchanged += type.layers_unchanged;
    changed += type.layers_merged + type.layers_split;
  }
  EXPECT_GT(unchanged, 0u);
  EXPECT_GT(changed, 0u);
  EXPECT_EQ(report.layers_stored, unchanged);
  EXPECT_EQ(static_cast<std::uint64_t>(source.loads), changed);
}

TEST(ResampleMap, ResolutionIsTheLargestCellThatIsNoLarger) {
  const Map map = random_map(6);
  ResampleOptions options;
  options.resolution_m = 1.0;  // 12.8 / 2^4 = 0.8
  EXPECT_EQ(difference(resample_map(map, options).map, resample_map(map, to_step(4)).map), "");
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

TEST(ResampleMap, RuleDecidesForEachLayer) {
  const Map map = random_map(8);
  const TypeId occupancy = *map.header().types.find("occupancy");
  ResampleOptions options;
  options.layers = {"occupancy", "hits"};
  options.rule = [&](const LayerInfo& layer) -> std::optional<int> {
    if (layer.type != occupancy) return std::nullopt;
    return std::min<int>(layer.step, layer.patch.x < 0 ? 1 : 4);
  };
  const Resampled out = resample_map(map, options);
  std::uint64_t others = 0;
  for (const auto& [key, patch] : out.map.by_key()) {
    for (const auto& [id, layer] : patch.layers) {
      EXPECT_NE(out.map.header().types[id].name, "hits");
      if (id == occupancy) {
        EXPECT_LE(layer.step(), patch.index.x < 0 ? 1 : 4);
      } else {
        EXPECT_TRUE(same_cells(layer, *map.find(patch.index, id)));
        ++others;
      }
    }
  }
  EXPECT_GT(others, 0u);
  const auto& hits = out.report.types[*map.header().types.find("hits")];
  EXPECT_EQ(hits.layers_dropped, map.summary().types[*map.header().types.find("hits")].layers);
  EXPECT_EQ(hits.cells_after, 0u);
}

TEST(ResampleMap, RuleMayDropWholePatches) {
  const Map map = random_map(8);
  ResampleOptions options;
  options.rule = [](const LayerInfo& layer) {
    return layer.patch.x < 0 ? std::nullopt : std::optional<int>(layer.step);
  };
  const Resampled out = resample_map(map, options);
  EXPECT_GT(out.report.patches_dropped, 0u);
  EXPECT_EQ(out.report.patches_dropped + out.map.size(), map.size());
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

TEST(ResampleMap, PolicyIsUsedAndStored) {
  const Map map = four_cells(LayerType::occupancy(), {{.9f, 0}, {0, .8f}, {0, .8f}, {0, .8f}});
  ResampleOptions options = to_step(0);
  options.policy = Policy::kMin;
  const Resampled out = resample_map(map, options);
  EXPECT_EQ(out.map.header().types[0].policy, Policy::kMin);
  EXPECT_EQ(out.map.find({0, 0}, 0)->plane(1)[0], 0);  // conditional: .06
  EXPECT_EQ(out.map.header().history.back().operation, "resample");
  EXPECT_EQ(out.map.header().history.back().parameters, R"({"policy":"min","step":0})");
}

TEST(ResampleMap, PolicyOfOtherLayersStays) {
  const Map map = random_map(2);
  ResampleOptions options = to_step(1);
  options.policy = Policy::kMaximum;
  options.layers = {"height"};
  const Map out = resample_map(map, options).map;
  for (const LayerType& type : out.header().types) {
    EXPECT_EQ(type.policy, type.name == "height"
                               ? Policy::kMaximum
                               : map.header().types[*map.header().types.find(type.name)].policy);
  }
}

TEST(ResampleMap, ChangingToCountsAndBackKeepsCellsWithoutData) {
  const float no = std::numeric_limits<float>::quiet_NaN();
  const Map map = four_cells(LayerType::real("h", {"x"}), {{3}, {no}, {no}, {5}});
  ResampleOptions options = to_step(1);
  options.policy = Policy::kSum;
  const Map counts = resample_map(test::StoredSource(map), options).map;
  EXPECT_EQ(counts.find({0, 0}, 0)->plane(0)[1], 0);
  EXPECT_EQ(counts.find({0, 0}, 0)->plane(0)[3], 5);
  options.policy = Policy::kMean;
  EXPECT_EQ(difference(resample_map(test::StoredSource(counts), options).map, map), "");
}

TEST(ResampleMap, RegridsOnceFromTheNativeCells) {
  const Map map = random_map(4);
  ResampleOptions options = to_step(3);
  options.edge_um = 10'000'000;
  options.datum_um = {{1'500'000, -700'000}};
  Frame target = map.header().frame;
  target.edge_um = 10'000'000;
  target.datum_x_um = 1'500'000;
  target.datum_y_um = -700'000;
  const auto expected_source = regrid(map, target, {}, 3);
  const Resampled out = resample_map(map, options);
  EXPECT_TRUE(out.map.header().frame == target);
  EXPECT_GT(out.map.size(), 0u);
  Layer expected;
  PatchInfo patch;
  for (const auto cursor = expected_source->patches(); cursor->next(patch);) {
    for (const LayerInfo& info : patch.layers) {
      expected_source->load(info, expected);
      const Layer* layer = out.map.find(info.patch, info.type);
      if (layer == nullptr) {
        EXPECT_TRUE(is_vacuous(expected, map.header().types[info.type]));
      } else {
        EXPECT_TRUE(same_cells(*layer, expected));
      }
    }
  }
  std::uint64_t before = 0;
  for (const auto& [key, p] : map.by_key()) {
    for (const auto& [id, layer] : p.layers) before += layer.cells();
  }
  std::uint64_t told = 0;
  const Summary after = out.map.summary();
  for (std::size_t t = 0; t < out.report.types.size(); ++t) {
    const auto& type = out.report.types[t];
    told += type.cells_before;
    EXPECT_EQ(type.layers_regridded, after.types[t].layers);
    EXPECT_EQ(type.cells_after, 64 * after.types[t].layers);
    EXPECT_EQ(type.layers_merged + type.layers_split + type.layers_unchanged, 0u);
  }
  EXPECT_EQ(told, before);
}

TEST(ResampleMap, TheSameGridIsNoRegridding) {
  const Map map = random_map(4);
  ResampleOptions options;
  options.edge_um = map.header().frame.edge_um;
  const Resampled out = resample_map(test::StoredSource(map), options);
  EXPECT_EQ(difference(out.map, map, true), "");
  EXPECT_GT(out.report.layers_stored, 0u);
}

TEST(ResampleMap, WatchSeesEveryLayerInOrderAndMayStop) {
  const Map map = random_map(9);
  std::vector<std::uint64_t> keys;
  const Resampled out = resample_map(map, to_step(2), threads(2),
                                     [&](const ResampledLayer& l) { keys.push_back(curve_key(l.patch)); });
  EXPECT_TRUE(std::is_sorted(keys.begin(), keys.end()));
  std::uint64_t layers = 0;
  for (const auto& type : map.summary().types) layers += type.layers;
  EXPECT_EQ(keys.size(), layers);
  struct Stop {};
  EXPECT_THROW(resample_map(map, to_step(2), threads(2), [](const ResampledLayer&) { throw Stop{}; }), Stop);
}

TEST(ResampleMap, BadOptionsAreRefusedBeforeACellIsRead) {
  const Map map = random_map(1);
  const test::StoredSource source(map);
  const auto refused = [&](const ResampleOptions& options, ErrorCode code, const std::string& message) {
    const Error error = failure(source, options);
    EXPECT_EQ(error.code(), code) << error.message();
    EXPECT_NE(error.message().find(message), std::string::npos) << error.message();
  };
  refused(to_step(12), ErrorCode::kLimit, "0..11");
  refused(to_step(-1), ErrorCode::kLimit, "0..11");
  ResampleOptions options;
  options.resolution_m = std::nan("");
  refused(options, ErrorCode::kInvalidArgument, "cell size");
  options.resolution_m = 1e-6;
  refused(options, ErrorCode::kLimit, "finer");
  options = to_step(2);
  options.policy = Policy::kMin;
  refused(options, ErrorCode::kInvalidArgument, "'min' does not fit layer 'height'");
  options = to_step(2);
  options.layers = {"heigth"};
  refused(options, ErrorCode::kInvalidArgument, "no layer 'heigth'");
  options = to_step(2);
  options.resolution_m = 1;
  refused(options, ErrorCode::kInvalidArgument, "exclude");
  options = {};
  options.edge_um = 5;
  refused(options, ErrorCode::kLimit, "patch edge");
  options.edge_um = 6'400'000;
  options.layers = {"height"};
  refused(options, ErrorCode::kInvalidArgument, "one grid");
  options = {};
  options.rule = [](const LayerInfo&) { return 99; };
  refused(options, ErrorCode::kLimit, "0..11");
  EXPECT_EQ(source.loads + source.stored_loads, 0);
}

TEST(ResampleMap, ALayerBeyondTheLimitIsRefused) {
  RandomMapOptions wide;
  wide.types = {LayerType::semantic("s", {"a", "b", "c", "d", "e"})};
  const Map map = random_map(1, wide);
  const Error error = failure(map, to_step(11));
  EXPECT_EQ(error.code(), ErrorCode::kLimit);
  EXPECT_NE(error.message().find("96 MiB"), std::string::npos) << error.message();
}

TEST(ResampleMap, BudgetCountsTheLayersToBe) {
  const Map map = four_cells(LayerType::occupancy(), {{.5f, 0}});
  RunOptions run;
  run.max_memory_bytes = 1 << 20;
  EXPECT_EQ(resample_map(map, to_step(4), run).report.types[0].layers_split, 1u);
  try {
    resample_map(map, to_step(9), run);
    FAIL() << "2 MiB in 1 MiB";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kLimit);
  }
}

TEST(ResampleMap, CanBeCancelled) {
  const std::atomic<bool> cancel{true};
  RunOptions run;
  run.cancel = &cancel;
  const Map map = random_map(1);
  try {
    resample_map(map, to_step(2), run);
    FAIL() << "not cancelled";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCancelled);
  }
}

}  // namespace
}  // namespace apgm
