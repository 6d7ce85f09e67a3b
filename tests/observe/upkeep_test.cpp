#include "observe/upkeep.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "random_map.hpp"

namespace apgm::observe {
namespace {

Map sample(std::uint64_t seed) {
  test::RandomMapOptions options;
  options.max_step = 6;
  return test::random_map(seed, options);
}

template <typename Work>
void for_each_layer(Map& map, Work work) {
  const Map names = map;
  for (const auto& [key, patch] : names.by_key()) {
    for (const auto& [type, layer] : patch.layers) {
      work(map.layer(patch.index, type, 0), map.header().types[type]);
    }
  }
}

TEST(AgeingTest, DependsOnTheTicksAndNotOnTheirPortions) {
  for (const double per_s : {0.999999, 0.99, 0.7, 0.01, 1e-9}) {
    const Ageing ageing(per_s);
    ASSERT_TRUE(ageing.active());
    Map at_once = sample(1), in_parts = sample(1);
    for_each_layer(at_once, [&](Layer& l, const LayerType& t) { ageing.apply(l, t, 37); });
    for (const int ticks : {1, 0, 20, 3, 13}) {
      for_each_layer(in_parts, [&](Layer& l, const LayerType& t) { ageing.apply(l, t, ticks); });
    }
    EXPECT_EQ(test::difference(at_once, in_parts), "") << per_s;
  }
}

TEST(AgeingTest, LeavesTheShareAndValidMasses) {
  for (const double per_s : {0.9999, 0.9, 0.5}) {
    const Ageing ageing(per_s);
    const Map before = sample(2);
    Map after = before;
    const std::int64_t ticks = ageing.tick_of(30'000'000'000) - ageing.tick_of(0);
    const double left = std::pow(per_s, 30.0);
    for_each_layer(after, [&](Layer& l, const LayerType& t) { ageing.apply(l, t, ticks); });
    for (const auto& [key, patch] : before.by_key()) {
      for (const auto& [type, layer] : patch.layers) {
        const LayerType& t = before.header().types[type];
        const Layer& aged = *after.find(patch.index, type);
        ASSERT_TRUE(is_canonical(aged, t));
        if (!t.is_evidence()) {
          ASSERT_TRUE(same_cells(aged, layer));
          continue;
        }
        for (std::size_t i = 0; i < layer.cells(); ++i) {
          ASSERT_NEAR(aged.plane(0)[i], left * layer.plane(0)[i], 0.0102 * left * layer.plane(0)[i] + 1e-7);
        }
      }
    }
  }
}

TEST(AgeingTest, EverythingFadesInTheEndAndNothingWithoutForgetting) {
  const Ageing ageing(0.9), never(1.0);
  EXPECT_FALSE(never.active());
  Map map = sample(3);
  const Map before = map;
  for_each_layer(map, [&](Layer& l, const LayerType& t) { never.apply(l, t, 1'000'000); });
  EXPECT_EQ(test::difference(map, before), "");
  for_each_layer(map, [&](Layer& l, const LayerType& t) {
    ageing.apply(l, t, std::int64_t{1} << 50);
    EXPECT_EQ(is_vacuous(l, t), t.is_evidence());
  });
}

TEST(AgeingTest, TicksDoNotOverflow) {
  constexpr auto kFirst = std::numeric_limits<std::int64_t>::min();
  constexpr auto kLast = std::numeric_limits<std::int64_t>::max();
  EXPECT_EQ(Ageing(1).tick_of(kLast), 0);
  const Ageing fast(1e-300);
  EXPECT_GT(fast.tick_of(kLast) - fast.tick_of(kFirst), 0);
}

TEST(AgeingTest, TicksOfNegativeTimesGoOn) {
  const Ageing ageing(0.5);
  EXPECT_EQ(ageing.tick_of(-1), -1);
  EXPECT_EQ(ageing.tick_of(0), 0);
}

TEST(KeepUnknownTest, BoundsTheSumsAndKeepsTheRatios) {
  for (const float least : {0.02f, 0.3f}) {
    const Map before = sample(4);
    Map after = before;
    for_each_layer(after, [&](Layer& l, const LayerType& t) { keep_unknown(l, t, {0, l.side()}, least); });
    for (const auto& [key, patch] : before.by_key()) {
      for (const auto& [type, layer] : patch.layers) {
        const LayerType& t = before.header().types[type];
        const Layer& kept = *after.find(patch.index, type);
        ASSERT_TRUE(is_canonical(kept, t));
        for (std::size_t i = 0; i < layer.cells() && t.is_evidence(); ++i) {
          double sum = 0, sum_before = 0;
          for (std::size_t c = 0; c < t.hypotheses.size(); ++c) {
            sum += kept.plane(static_cast<int>(c))[i];
            sum_before += layer.plane(static_cast<int>(c))[i];
          }
          ASSERT_LE(sum, 1 - least + 1.2e-6);
          ASSERT_NEAR(sum, std::min(sum_before, 1.0 - static_cast<double>(least)), 1.2e-6);
          ASSERT_NEAR(kept.plane(0)[i] * sum_before, layer.plane(0)[i] * sum, 1e-6);
        }
      }
    }
    Map twice = after;
    for_each_layer(twice, [&](Layer& l, const LayerType& t) { keep_unknown(l, t, {0, l.side()}, least); });
    EXPECT_EQ(test::difference(twice, after), "");
  }
}

TEST(KeepUnknownTest, OtherRowsStay) {
  LayerType type = LayerType::occupancy();
  Layer layer(type, 3);
  std::ranges::fill(layer.plane(0), 1.0f);
  keep_unknown(layer, type, {2, 5}, 0.25f);
  for (int b = 0; b < 8; ++b) {
    for (int a = 0; a < 8; ++a) EXPECT_EQ(layer.at(0, {a, b}), b >= 2 && b < 5 ? 0.75f : 1.0f);
  }
}

}  // namespace
}  // namespace apgm::observe
