#include "apgm/ops/merge.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "apgm/fuse/framework.hpp"
#include "apgm/ops/crop.hpp"
#include "random_map.hpp"
#include "stored_map.hpp"

namespace apgm {
namespace {

using test::difference;
using test::random_map;
using test::RandomMapOptions;

std::vector<MergeInput> inputs_of(std::vector<const PatchSource*> sources) {
  std::vector<MergeInput> inputs;
  for (const PatchSource* source : sources) {
    inputs.push_back({source, std::string(1, static_cast<char>('a' + inputs.size())) + ".apgm", 1.0f});
  }
  return inputs;
}

struct Merged {
  Map map;
  MergeReport report;
};

Merged merge_inputs(std::vector<MergeInput> inputs, const MergeOptions& options = {},
                    const RunOptions& run = {}) {
  const MergePlan plan(std::move(inputs), options);
  Merged m{Map(plan.header()), {}};
  test::StoredSink sink(m.map);
  m.report = plan.run(sink, run);
  sink.finish();
  return m;
}

Merged merge(std::vector<const PatchSource*> sources, const MergeOptions& options = {},
             const RunOptions& run = {}) {
  return merge_inputs(inputs_of(std::move(sources)), options, run);
}

RunOptions threads(int n) {
  RunOptions run;
  run.threads = n;
  return run;
}

Error failure_of(const std::vector<MergeInput>& inputs, const MergeOptions& options = {}) {
  try {
    const MergePlan plan(inputs, options);
  } catch (const Error& e) {
    return e;
  }
  return {ErrorCode::kCancelled, "no failure"};
}

TEST(Merge, DoesNotDependOnTheOrderOfInputsOrOnThreads) {
  for (std::uint64_t seed = 0; seed < 15; ++seed) {
    SCOPED_TRACE(seed);
    const Map a = random_map(3 * seed), b = random_map(3 * seed + 1), c = random_map(3 * seed + 2);
    const Merged abc = merge({&a, &b, &c}, {}, threads(1));
    EXPECT_GT(abc.report.patches, 0u);
    for (const Merged& other : {merge({&c, &a, &b}, {}, threads(2)), merge({&b, &c, &a}, {}, threads(4)),
                                merge({&a, &b, &c}, {}, threads(2))}) {
      EXPECT_EQ(difference(abc.map, other.map, true), "");
      EXPECT_EQ(other.report.total_conflicts, abc.report.total_conflicts);
      EXPECT_EQ(other.report.layers_stored, abc.report.layers_stored);
      EXPECT_EQ(other.map.header().history, abc.map.header().history);
      EXPECT_TRUE(other.map.header().types == abc.map.header().types);
    }
  }
}

TEST(Merge, AgreesWithTheFrameworkInMemory) {
  for (std::uint64_t seed = 100; seed < 110; ++seed) {
    SCOPED_TRACE(seed);
    const Map a = random_map(seed), b = random_map(seed + 1000);
    for (const std::optional<double> resolution : {std::optional<double>{}, std::optional<double>{1.6}}) {
      MergeOptions options;
      options.resolution_m = resolution;
      const std::vector<const Map*> maps{&a, &b};
      Map expected = fuse_maps(maps, resolution ? std::optional(3) : std::nullopt);
      expected.prune();
      EXPECT_EQ(difference(merge({&a, &b}, options).map, expected), "");
    }
  }
}

TEST(Merge, WithAnEmptyMapKeepsEveryBit) {
  const Map a = random_map(1);
  MapHeader far = a.header();
  far.frame.datum_x_um = 123;  // does not vote
  const Map empty(far);
  const test::StoredSource source(a);
  for (const auto& inputs : {inputs_of({&source, &empty}), inputs_of({&empty, &source})}) {
    const Merged m = merge_inputs(inputs);
    EXPECT_EQ(difference(m.map, a, true), "");
    EXPECT_TRUE(m.map.header().frame == a.header().frame);
    EXPECT_EQ(m.report.layers_stored, m.report.layers);
  }
  EXPECT_EQ(source.loads, 0);
}

TEST(Merge, OfEmptyMapsIsAnEmptyMap) {
  const Map empty(MapHeader{{}, TypeTable({LayerType::occupancy()}), {}, {}, 0});
  const Merged m = merge({&empty, &empty});
  EXPECT_EQ(m.map.size(), 0u);
  EXPECT_EQ(m.map.header().types.size(), 1u);
  EXPECT_EQ(m.report.patches, 0u);
}

TEST(Merge, PassesLayersOfOneInputAsStored) {
  RandomMapOptions west, east;
  west.range = {{-4, -4}, {0, 3}};
  east.range = {{0, -4}, {4, 3}};
  const Map a = random_map(1, west), b = random_map(2, east);
  const test::StoredSource sa(a), sb(b);
  const Merged m = merge({&sa, &sb});
  std::uint64_t alone = 0, shared = 0;
  for (const auto& [key, patch] : m.map.by_key()) {
    for (const auto& [id, layer] : patch.layers) {
      (a.find(patch.index, id) && b.find(patch.index, id) ? shared : alone) += 1;
    }
  }
  EXPECT_GT(shared, 0u);
  EXPECT_EQ(m.report.layers_stored, alone);
  EXPECT_EQ(static_cast<std::uint64_t>(sa.loads + sb.loads), 2 * shared);
}

TEST(Merge, ResamplesALayerThatIsAloneAndTooFine) {
  RandomMapOptions fine;
  fine.min_step = fine.max_step = 5;
  const Map a = random_map(1, fine);
  MergeOptions options;
  options.resolution_m = 1.6;
  const test::StoredSource source(a);
  const Merged m = merge({&source}, options);
  EXPECT_EQ(m.report.layers_stored, 0u);
  for (const auto& [key, patch] : m.map.by_key()) {
    for (const auto& [id, layer] : patch.layers) EXPECT_EQ(layer.step(), 3);
  }
}

TEST(Merge, DiscountsInputsBeforeTheyAreCombined) {
  RandomMapOptions options;
  options.types = {LayerType::occupancy()};
  const Map a = random_map(1, options);
  auto half = inputs_of({&a});
  half[0].alpha = 0.5f;
  const Merged m = merge_inputs(half);
  ASSERT_EQ(m.map.size(), a.size());
  for (const auto& [key, patch] : a.by_key()) {
    const Layer &before = patch.layers.at(0), &after = *m.map.find(patch.index, 0);
    for (std::size_t i = 0; i < before.cells(); ++i) {
      ASSERT_EQ(after.plane(0)[i], before.plane(0)[i] * 0.5f);
      ASSERT_EQ(after.plane(1)[i], before.plane(1)[i] * 0.5f);
    }
  }
  half[0].alpha = 0;
  EXPECT_EQ(merge_inputs(half).map.size(), 0u);
  half[0].alpha = 1.5f;
  EXPECT_EQ(failure_of(half).code(), ErrorCode::kInvalidArgument);
}

TEST(Merge, OfCropsIsTheCropOfTheMerge) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    SCOPED_TRACE(seed);
    test::Random random(seed);
    RandomMapOptions options;
    options.min_step = 2;
    const Map a = random_map(2 * seed, options), b = random_map(2 * seed + 1, options);
    // Whole cells of step 2: 3.2 m.
    const int x = random.in(-12, 4), y = random.in(-12, 4);
    const Box box{{x * 3.2, y * 3.2}, {(x + random.in(1, 10)) * 3.2, (y + random.in(1, 10)) * 3.2}};
    const CropRegion region{box, {}, nullptr};
    const auto cropped = [&](const PatchSource& source) {
      Map out(crop_header(source, region, {}));
      MapSink sink(out);
      crop(source, region, {}, sink);
      return out;
    };
    const Map ca = cropped(a), cb = cropped(b);
    const Map left = merge({&ca, &cb}).map, right = cropped(merge({&a, &b}).map);
    // A layer whose known cells all lie outside is gone before the merge: it no longer asks for its step.
    std::size_t compared = 0;
    for (const auto& [key, patch] : right.by_key()) {
      for (const auto& [id, layer] : patch.layers) {
        const Layer* twin = left.find(patch.index, id);
        ASSERT_NE(twin, nullptr);
        const bool both = (ca.find(patch.index, id) != nullptr) == (a.find(patch.index, id) != nullptr) &&
                          (cb.find(patch.index, id) != nullptr) == (b.find(patch.index, id) != nullptr);
        if (!both) continue;
        EXPECT_TRUE(same_cells(layer, *twin));
        ++compared;
      }
    }
    EXPECT_EQ(left.size(), right.size());
    EXPECT_GT(compared + (right.size() == 0), 0u);
  }
}

TEST(Merge, ShiftsInputsByWholePatchesAsStored) {
  const Map a = random_map(1);
  RandomMapOptions options;
  options.frame.datum_x_um = 2 * 12'800'000;
  options.frame.datum_y_um = -12'800'000;
  options.range = {{-5, -2}, {0, 3}};  // the same patches on the ground
  const Map b = random_map(1, options);
  RandomMapOptions moved;
  moved.frame.datum_x_um = -12'800'000 * 3;
  const Map origin = random_map(50, moved);
  const test::StoredSource sa(a), sb(b);
  const Merged m = merge({&sa, &sb});
  EXPECT_EQ(m.map.header().frame.datum_x_um, 0);
  EXPECT_EQ(m.map.header().frame.datum_y_um, 0);
  const Merged expected = merge({&a, &a});
  EXPECT_EQ(difference(m.map, expected.map, true), "");
  const Merged three = merge({&origin, &sb});
  EXPECT_EQ(three.map.header().frame.datum_x_um, -12'800'000 * 3);
}

TEST(Merge, ShiftsInputsByWholeCells) {
  RandomMapOptions options;
  options.min_step = options.max_step = 4;  // cells of 0.8 m
  const Map a = random_map(1, options);
  options.frame.datum_x_um = 5 * 800'000;
  options.frame.datum_y_um = 19 * 800'000;
  const Map b = random_map(2, options);
  const Map m = merge({&b, &a}).map;
  EXPECT_EQ(m.header().frame.datum_x_um, 0);
  const Map* maps[] = {&a, &b};
  // Where one map alone holds data, the other's cells stand unchanged.
  std::size_t compared = 0;
  for (const auto& [key, patch] : b.by_key()) {
    for (const auto& [id, layer] : patch.layers) {
      for (int y = 0; y < 16; ++y) {
        for (int x = 0; x < 16; ++x) {
          const std::int64_t gx = patch.index.x * 16 + x + 5, gy = patch.index.y * 16 + y + 19;
          const PatchIndex at{static_cast<int>(floor_div(gx, 16)), static_cast<int>(floor_div(gy, 16))};
          if (maps[0]->find(at, id) != nullptr) continue;
          const CellIndex cell{static_cast<int>(gx - at.x * 16), static_cast<int>(gy - at.y * 16)};
          const Layer* fused = m.find(at, id);
          for (int c = 0; c < layer.channels(); ++c) {
            const float v = layer.at(c, {x, y});
            const float got = fused != nullptr ? fused->at(c, cell) : m.header().types[id].background(c);
            ASSERT_TRUE(v == got || (std::isnan(v) && std::isnan(got)));
            ++compared;
          }
        }
      }
    }
  }
  EXPECT_GT(compared, 1000u);
}

TEST(MergePlan, RefusesBrokenDistances) {
  const Map a = random_map(1);
  RandomMapOptions options;
  options.frame.datum_x_um = 50'000;
  const Map b = random_map(2, options);
  const Error e = failure_of(inputs_of({&a, &b}));
  EXPECT_EQ(e.code(), ErrorCode::kIncompatible);
  EXPECT_THAT(e.message(),
              testing::AllOf(testing::HasSubstr("a.apgm"), testing::HasSubstr("b.apgm"),
                             testing::HasSubstr("(0 m, 0 m)"), testing::HasSubstr("(0.05 m, 0 m)")));
  EXPECT_THAT(e.hint(), testing::HasSubstr("--regrid"));
}

TEST(MergePlan, RefusesOtherEdgesFramesAndReferenceSystems) {
  const Map a = random_map(1);
  const auto other = [](auto change) {
    RandomMapOptions options;
    change(options.frame);
    return random_map(2, options);
  };
  const Map edge = other([](Frame& f) { f.edge_um = 10'000'000; });
  EXPECT_THAT(failure_of(inputs_of({&a, &edge})).hint(), testing::HasSubstr("--regrid"));
  const Map odom = other([](Frame& f) { f.frame_id = "odom"; });
  const Error e = failure_of(inputs_of({&a, &odom}));
  EXPECT_EQ(e.message(), "cannot merge 'a.apgm' and 'b.apgm': frames differ ('map' and 'odom')");
  EXPECT_EQ(e.hint(), "pass --assume-frame map if they are the same");
  MergeOptions assume;
  assume.assume_frame_id = "map";
  EXPECT_EQ(MergePlan(inputs_of({&odom, &a}), assume).header().frame.frame_id, "map");
  const Map utm32 = other([](Frame&f) { f.epsg = 25832; }), utm33 = other([](Frame&f) { f.epsg = 25833; });
  EXPECT_EQ(failure_of(inputs_of({&utm32, &utm33})).code(), ErrorCode::kIncompatible);
  std::vector<std::string> notes;
  RunOptions run;
  run.findings = [&](const Finding& f) { notes.push_back(f.text); };
  EXPECT_EQ(merge({&a, &utm32}, {}, run).map.header().frame.epsg, 25832);
  EXPECT_THAT(notes, testing::ElementsAre(testing::HasSubstr("25832")));
}

TEST(MergePlan, RegridsWhenAsked) {
  RandomMapOptions options;
  options.types = {LayerType::occupancy()};
  const Map a = random_map(1, options);
  options.frame.datum_x_um = 50'000;
  const Map b = random_map(2, options);
  MergeOptions regrid;
  regrid.regrid = true;
  const Merged ab = merge({&a, &b}, regrid), ba = merge({&b, &a}, regrid);
  EXPECT_EQ(difference(ab.map, ba.map, true), "");
  EXPECT_GE(ab.map.size(), a.size());
}

TEST(MergePlan, JoinsHeaders) {
  MapHeader h;
  h.types = TypeTable({LayerType::occupancy()});
  h.metadata = {{"site", "here"}, {"by", "x"}};
  h.history = {{"convert", {"octomap"}, "{}"}};
  h.stamp_ns = 5;
  const Map a(h);
  h.types = TypeTable({LayerType::real("z", {"z"})});
  h.metadata["by"] = "y";
  h.stamp_ns = 7;
  const Map b(h);
  auto inputs = inputs_of({&a, &b});
  inputs[1].alpha = 0.5f;
  const MapHeader m = MergePlan(inputs, {}).header();
  EXPECT_EQ(m.types.size(), 2u);
  EXPECT_THAT(m.metadata, testing::ElementsAre(testing::Pair("site", "here")));
  EXPECT_EQ(m.stamp_ns, 7);
  ASSERT_EQ(m.history.size(), 2u);
  EXPECT_EQ(m.history[0].operation, "convert");
  EXPECT_EQ(m.history[1].operation, "merge");
  EXPECT_THAT(m.history[1].inputs, testing::ElementsAre("unknown", "unknown"));
  EXPECT_EQ(m.history[1].parameters, R"({"discounts":[0.5,1],"rule":"dempster"})");
}

/// Counts the cells whose conflict is total.
class CountTotal final : public ConflictSink {
 public:
  void put(PatchIndex, TypeId type, int step, std::span<const float> conflict) override {
    EXPECT_EQ(conflict.size(), std::size_t{1} << (2 * step));
    EXPECT_EQ(type, 0);
    for (const float k : conflict) {
      EXPECT_GE(k, 0.0f);
      EXPECT_LE(k, 1.0f);
      total += k == 1.0f;
    }
  }
  std::uint64_t total = 0;
};

TEST(Merge, ReportsTotalConflicts) {
  RandomMapOptions options;
  options.types = {LayerType::occupancy()};
  Map a = random_map(1, options), b = random_map(1, options);
  std::uint64_t expected = 0;
  for (const auto& [key, patch] : a.by_key()) {
    Layer &la = a.layer(patch.index, 0, 0), &lb = b.layer(patch.index, 0, 0);
    for (std::size_t i = 0; i < la.cells(); i += 3, ++expected) {
      la.plane(0)[i] = lb.plane(1)[i] = 1;
      la.plane(1)[i] = lb.plane(0)[i] = 0;
    }
  }
  CountTotal conflicts;
  MergeOptions merging;
  merging.conflict = &conflicts;
  const Merged m = merge({&a, &b}, merging, threads(2));
  EXPECT_EQ(m.report.total_conflicts, expected);
  EXPECT_EQ(conflicts.total, expected);
}

TEST(Merge, FailsAsItsInputsDo) {
  const Map a = random_map(1), b = random_map(2);
  test::StoredSource source(a);
  source.damaged = a.by_key().rbegin()->second.index;
  for (const int n : {1, 2}) {
    try {
      merge({&source, &b}, {}, threads(n));
      FAIL() << "no failure";
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::kDamaged);
    }
  }
}

TEST(Merge, RefusesABudgetBelowOnePatch) {
  const Map a = random_map(1), b = random_map(2);
  RunOptions run;
  run.max_memory_bytes = 1000;
  try {
    merge({&a, &b}, {}, run);
    FAIL() << "no failure";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kLimit);
  }
  run.max_memory_bytes = 1 << 20;
  EXPECT_GT(merge({&a, &b}, {}, run).report.patches, 0u);
}

}  // namespace
}  // namespace apgm
