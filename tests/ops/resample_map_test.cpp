#include "apgm/ops/resample_map.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "apgm/fuse/regrid.hpp"
#include "apgm/fuse/resample.hpp"
#include "resampled.hpp"

namespace apgm {
namespace {

using namespace test;

Error failure(const PatchSource& source, const ResampleOptions& options) {
  try {
    resample_map(source, options);
  } catch (const Error& error) {
    return error;
  }
  return {ErrorCode::kCancelled, "no failure"};
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
