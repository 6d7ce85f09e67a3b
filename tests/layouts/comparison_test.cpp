#include "apgm/layouts/comparison.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "apgm/core/error.hpp"
#include "apgm/fuse/resample.hpp"
#include "apgm/layouts/nonuniform_grid.hpp"
#include "apgm/layouts/submap_grid.hpp"
#include "support.hpp"

namespace apgm {
namespace {

/// Occupancy and a height, which is no belief.
Map small_map(Frame frame = {}) {
  MapHeader header;
  header.frame = frame;
  header.types = TypeTable({LayerType::occupancy(), LayerType::real("height", {"z"})});
  return Map(std::move(header));
}

void set(Map& map, PatchIndex patch, int step, CellIndex cell, float occupied, float free) {
  Layer& layer = map.layer(patch, *map.header().types.find("occupancy"), step);
  layer.at(0, cell) = occupied;
  layer.at(1, cell) = free;
}

TEST(BeliefChangeOfMaps, IsNoneForTheMapItself) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    SCOPED_TRACE(seed);
    const Map map = test::random_map(seed, {});
    const BeliefChange change = belief_change(map, map);
    EXPECT_GT(change.known_cells, 100u);
    EXPECT_EQ(change.lost_cells, 0u);
    EXPECT_EQ(change.sum, 0);
    EXPECT_EQ(change.most, 0);
    EXPECT_EQ(change.obstacles, 0u);
  }
}

TEST(BeliefChangeOfMaps, IsTheDifferenceOfBetP) {
  Map map = small_map(), back = small_map();
  set(map, {0, 0}, 3, {0, 0}, 0.75f, 0);  // BetP(O) 0.875
  set(back, {0, 0}, 3, {0, 0}, 0.5f, 0.25f);
  set(map, {0, 0}, 3, {1, 0}, 0.5f, 0);  // 0.75, then 0.375: an obstacle less
  set(back, {0, 0}, 3, {1, 0}, 0, 0.25f);
  set(map, {0, 0}, 3, {2, 0}, 0, 0.5f);  // gives nothing back
  set(map, {-1, 4}, 3, {2, 5}, 1, 0);    // nor does its patch
  set(back, {7, 7}, 3, {0, 0}, 1, 0);    // of no account
  map.layer({0, 0}, *map.header().types.find("height"), 3).at(0, {4, 4}) = 3;
  const BeliefChange change = belief_change(back, map);
  EXPECT_EQ(change.known_cells, 4u);
  EXPECT_EQ(change.lost_cells, 2u);
  EXPECT_DOUBLE_EQ(change.sum, 0.25 + 0.375);
  EXPECT_DOUBLE_EQ(change.most, 0.375);
  EXPECT_DOUBLE_EQ(change.mean(), (0.25 + 0.375) / 2);
  EXPECT_EQ(change.obstacles, 1u);
}

TEST(BeliefChangeOfMaps, ComparesAtTheMapsOwnStep) {
  Map map = small_map(), back = small_map();
  set(map, {0, 0}, 3, {1, 1}, 0.75f, 0);
  Layer split;
  resample(*map.find({0, 0}, 1), map.header().types[1], 5, split);
  ASSERT_EQ(map.header().types[1].name, "occupancy");
  back.layer({0, 0}, 1, 5) = split;
  EXPECT_LT(belief_change(back, map).most, 1e-6);
  EXPECT_EQ(belief_change(back, map).lost_cells, 0u);
}

TEST(BeliefChangeOfMaps, TypesThatAreMissingAreLost) {
  Map map = small_map();
  set(map, {0, 0}, 3, {1, 1}, 0.75f, 0);
  MapHeader header;
  header.types = TypeTable({LayerType::real("height", {"z"})});
  EXPECT_EQ(belief_change(Map(header), map).lost_cells, 1u);
}

TEST(BeliefChangeOfMaps, NeedsThePatchesAndTheChannels) {
  Map map = small_map();
  set(map, {0, 0}, 3, {1, 1}, 0.75f, 0);
  EXPECT_THROW(belief_change(small_map(test::frame_at(1, 0)), map), Error);
  EXPECT_THROW(belief_change(small_map(test::frame_at(0, 0, 6'400'000)), map), Error);
  MapHeader header;
  header.types = TypeTable({LayerType::semantic("occupancy", {"a", "b"})});
  Map other(header);
  other.layer({0, 0}, 0, 3);
  EXPECT_THROW(belief_change(other, map), Error);
}

/// The change by hand: every cell of the map beside what to_map gives there.
BeliefChange by_hand(const Layout& layout, const Map& map) {
  const Map back = to_map(layout, map.header().frame);
  BeliefChange change;
  for (const auto& [key, patch] : map.by_key()) {
    for (const auto& [id, layer] : patch.layers) {
      const LayerType& type = map.header().types[id];
      if (!type.is_evidence()) continue;
      const auto classes = static_cast<int>(type.hypotheses.size());
      Layer after;
      const Layer* found = back.find(patch.index, id);
      if (found != nullptr) resample(*found, type, layer.step(), after);
      for (std::size_t i = 0; i < layer.cells(); ++i) {
        double was = 0, is = 0, most = 0;
        for (int h = 0; h < classes; ++h) {
          was += static_cast<double>(layer.plane(h)[i]);
          if (found != nullptr) is += static_cast<double>(after.plane(h)[i]);
        }
        if (was == 0) continue;
        ++change.known_cells;
        if (is == 0) {
          ++change.lost_cells;
          continue;
        }
        for (int h = 0; h < classes; ++h) {
          const double a = static_cast<double>(layer.plane(h)[i]) + (1 - was) / classes;
          const double b = static_cast<double>(after.plane(h)[i]) + (1 - is) / classes;
          most = std::max(most, std::fabs(a - b));
        }
        change.sum += most;
        change.most = std::max(change.most, most);
      }
    }
  }
  return change;
}

class BeliefChangeOfLayouts : public testing::TestWithParam<std::uint64_t> {};

TEST_P(BeliefChangeOfLayouts, IsWhatTheyGiveBack) {
  test::RandomMapOptions options;
  options.range = {{-10, -10}, {9, 9}};
  options.fill = 0.3;
  options.max_step = 6;
  const Map map = test::random_map(GetParam(), options);
  const auto grid =
      make_nonuniform_grid(CellSchema(map.header().types), map.header().frame, buerkle_preset("A"));
  grid->move_to({31.7, -12.3});
  fill(*grid, map);
  const BeliefChange want = by_hand(*grid, map), change = belief_change(*grid, map);
  EXPECT_EQ(change.known_cells, want.known_cells);
  EXPECT_EQ(change.lost_cells, want.lost_cells);
  EXPECT_NEAR(change.sum, want.sum, 1e-6 * want.sum);
  EXPECT_NEAR(change.most, want.most, 1e-9);
  EXPECT_GT(change.lost_cells, 0u);
  EXPECT_GT(change.most, 0.1);
}
INSTANTIATE_TEST_SUITE_P(Seeds, BeliefChangeOfLayouts, testing::Values(31, 32));

CostOptions few() {
  CostOptions options;
  options.accesses = 50;
  options.growths = 4;
  // Every reading is a millisecond later than the one before.
  options.now_ns = [now = std::int64_t{0}]() mutable { return now += 1'000'000; };
  return options;
}

TEST(MeasureMapCost, DividesByWhatWasDone) {
  const Map map = test::random_map(5, {});
  std::uint64_t cells = 0;
  for (const auto& [key, patch] : map.by_key()) {
    for (const auto& [type, layer] : patch.layers) cells += layer.cells();
  }
  const LayoutCost cost = measure_cost(map, 7, few());
  EXPECT_EQ(cost.snapshot_ns, 1e6);
  EXPECT_EQ(cost.find_ns, 1e6 / 50);
  EXPECT_EQ(cost.insert_ns, 1e6 / 50);
  EXPECT_EQ(cost.iterate_ns, 1e6 / static_cast<double>(cells));
  EXPECT_EQ(cost.grow_ns, 1e6 / 4);
  EXPECT_EQ(cost.shift_ns, 0);
}

TEST(MeasureMapCost, LeavesTheMapAlone) {
  const Map map = test::random_map(6, {}), before = map;
  CostOptions real = few();
  real.now_ns = nullptr;
  EXPECT_GT(measure_cost(map, 7, real).find_ns, 0);
  ASSERT_EQ(map.size(), before.size());
  for (const auto& [key, patch] : map.by_key()) {
    for (const auto& [type, layer] : patch.layers) {
      const Layer& same = *before.find(patch.index, type);
      for (int c = 0; c < layer.channels(); ++c) {
        EXPECT_TRUE(std::ranges::equal(layer.plane(c), same.plane(c),
                                       [](float a, float b) { return std::memcmp(&a, &b, sizeof a) == 0; }));
      }
    }
  }
}

TEST(MeasureMapCost, NeedsCells) {
  EXPECT_THROW(measure_cost(small_map(), 1), Error);
  Map map = small_map();
  map.layer({0, 0}, 0, 2);
  CostOptions none;
  none.growths = 0;
  EXPECT_THROW(measure_cost(map, 1, none), Error);
}

TEST(MeasureMapCost, NothingGrowsAtTheEndOfAllIndices) {
  constexpr std::int32_t kLast = std::numeric_limits<std::int32_t>::max();
  for (const PatchIndex last : {PatchIndex{0, kLast}, PatchIndex{kLast, 0}}) {
    Map map = small_map(test::frame_at(0, 0, 1'000'000));
    map.layer(last, 0, 2);
    EXPECT_EQ(measure_cost(map, 1, few()).grow_ns, 0);
  }
}

}  // namespace
}  // namespace apgm
