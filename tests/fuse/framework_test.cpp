#include "apgm/fuse/framework.hpp"

#include <gtest/gtest.h>

#include "apgm/core/error.hpp"
#include "apgm/fuse/resample.hpp"
#include "layers.hpp"

namespace apgm {
namespace {

using test::Random;

const LayerType kConditional = LayerType::occupancy();
const LayerType kExclusive = LayerType::occupancy("occupancy", Policy::kExclusive);

TEST(FusedStep, IsTheFinestPresentOrTheRequired) {
  EXPECT_EQ(fused_step(std::array{5, 7, 6}, {}), 7);
  EXPECT_EQ(fused_step(std::array{5, 7, 6}, 6), 6);
  EXPECT_EQ(fused_step(std::array{5, 4}, 7), 5);
}

TEST(LayerFuser, ResamplesThenFuses) {
  Random random(61);
  const Layer fine = test::random_occupancy(4, random), coarse = test::random_exclusive(2, random);
  LayerFuser fuser;
  for (const std::optional<int> required :
       {std::optional<int>{}, std::optional<int>{3}, std::optional<int>{1}}) {
    const int step = std::min(required.value_or(4), 4);
    Layer a, b, want, got;
    resample(fine, kConditional, step, a);
    resample(coarse, kExclusive, step, b);
    combine(std::array<const Layer*, 2>{&a, &b}, kConditional, Rule::kDempster, want);
    const std::array<FuseInput, 2> inputs{{{&fine, &kConditional, 1.0f}, {&coarse, &kExclusive, 1.0f}}};
    std::vector<float> conflict;
    fuser.fuse(inputs, required, Rule::kDempster, got, &conflict);
    EXPECT_TRUE(same_cells(want, got));
    EXPECT_EQ(conflict.size(), got.cells());
  }
}

TEST(LayerFuser, LoneLayerIsBroughtToTheRequiredStep) {
  Random random(62);
  const Layer in = test::random_occupancy(4, random);
  Layer want, got;
  resample(in, kConditional, 2, want);
  LayerFuser().fuse(std::array<FuseInput, 1>{{{&in, &kConditional, 1.0f}}}, 2, Rule::kDempster, got);
  EXPECT_TRUE(same_cells(want, got));
}

TEST(LayerFuser, DiscountsAnInput) {
  const Layer a = test::occupancy_of(0, {{0.8f, 0.0f}}), b = test::occupancy_of(0, {{0.0f, 0.6f}});
  Layer trusted = b, want, got;
  discount(trusted, kConditional, 0.5f);
  combine(std::array<const Layer*, 2>{&a, &trusted}, kConditional, Rule::kDempster, want);
  LayerFuser().fuse(std::array<FuseInput, 2>{{{&a, &kConditional, 1.0f}, {&b, &kConditional, 0.5f}}}, {},
                    Rule::kDempster, got);
  EXPECT_TRUE(same_cells(want, got));
}

TEST(LayerFuser, DiscountsALoneLayerWhereItStands) {
  Random random(66);
  for (const int step : {0, 3, 6}) {
    Layer a = test::random_occupancy(step, random), want = a;
    discount(want, kConditional, 0.25f);
    std::vector<float> k;
    LayerFuser().fuse(std::array<FuseInput, 1>{{{&a, &kConditional, 0.25f}}}, {}, Rule::kDempster, a, &k);
    EXPECT_TRUE(same_cells(want, a));
    EXPECT_EQ(k, std::vector<float>(a.cells(), 0.0f));
  }
}

TEST(LayerFuser, OutputMayBeAnInputAtAnyStep) {
  Random random(65);
  LayerFuser fuser;
  for (const auto& [first, second] : {std::pair{4, 4}, std::pair{3, 5}, std::pair{5, 3}, std::pair{0, 6}}) {
    for (const std::optional<int> required : {std::optional<int>{}, std::optional<int>{2}}) {
      for (const float alpha : {1.0f, 0.5f}) {
        Layer a = test::random_occupancy(first, random), b = test::random_occupancy(second, random), want;
        a.stamp_ns = 3;
        b.stamp_ns = 7;
        const std::array<FuseInput, 2> inputs{{{&a, &kConditional, alpha}, {&b, &kConditional, 1.0f}}};
        std::vector<float> k, k_in_place;
        fuser.fuse(inputs, required, Rule::kDempster, want, &k);
        Layer kept = a;
        fuser.fuse(inputs, required, Rule::kDempster, a, &k_in_place);
        EXPECT_TRUE(same_cells(want, a)) << first << ' ' << second;
        EXPECT_EQ(k, k_in_place);
        EXPECT_EQ(a.stamp_ns, 7);
        std::swap(a, kept);
        fuser.fuse(inputs, required, Rule::kDempster, b);
        EXPECT_TRUE(same_cells(want, b)) << first << ' ' << second;
      }
    }
  }
}

TEST(LayerFuser, LargeLayersAreMadeInStripsWithTheSameBits) {
  // Beyond what one strip holds.
  Random random(66);
  const Layer fine = test::random_occupancy(9, random), coarse = test::random_occupancy(3, random);
  Layer discounted = fine, split, want, got;
  discount(discounted, kConditional, 0.75f);
  resample(coarse, kConditional, 9, split);
  combine(std::array<const Layer*, 2>{&discounted, &split}, kConditional, Rule::kYager, want);
  LayerFuser().fuse(std::array<FuseInput, 2>{{{&fine, &kConditional, 0.75f}, {&coarse, &kConditional, 1.0f}}},
                    {}, Rule::kYager, got);
  EXPECT_TRUE(same_cells(want, got));
}

TEST(LayerFuser, RefusesWhatDoesNotFit) {
  const Layer a(kConditional, 2);
  const LayerType other = LayerType::occupancy("other");
  LayerFuser fuser;
  Layer out;
  const auto fuse = [&](const LayerType& type, float alpha, int required) {
    fuser.fuse(std::array<FuseInput, 2>{{{&a, &kConditional, 1.0f}, {&a, &type, alpha}}}, required,
               Rule::kDempster, out);
  };
  EXPECT_NO_THROW(fuse(kConditional, 0.5f, 1));
  EXPECT_THROW(fuse(other, 1.0f, 1), Error);
  EXPECT_THROW(fuse(kConditional, 1.5f, 1), Error);
  EXPECT_THROW(fuse(kConditional, NAN, 1), Error);
  EXPECT_THROW(fuse(kConditional, 1.0f, -1), Error);
}

TEST(FusedTypes, JoinsByName) {
  const TypeTable a({kExclusive, LayerType::real("height", {"z"}, Policy::kMaximum)});
  const TypeTable b({kExclusive, LayerType::semantic("surface", {"Road", "Grass"})});
  const TypeTable joined = fused_types(std::array{&a, &b});
  ASSERT_EQ(joined.size(), 3u);
  EXPECT_EQ(joined[*joined.find("occupancy")].policy, Policy::kConditional);
  EXPECT_EQ(fused_types(std::array{&a}), a);
  const TypeTable c({kConditional});
  EXPECT_EQ(fused_types(std::array{&a, &c})[1].policy, Policy::kConditional);
  EXPECT_EQ(fused_types(std::array{&a, &c}), fused_types(std::array{&c, &a}));
}

TEST(FusedTypes, RefusesWhatDoesNotFit) {
  const TypeTable a({kConditional});
  LayerType slab = kConditional;
  slab.slab = Slab{0, 1'000'000};
  for (const LayerType& other :
       {LayerType::semantic("occupancy", {"O", "F"}), slab, LayerType::real("occupancy", {"O", "F"}),
        LayerType::occupancy("occupancy", Policy::kMin)}) {
    const TypeTable b({other});
    try {
      fused_types(std::array{&a, &b});
      ADD_FAILURE() << "joined";
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::kIncompatible);
    }
  }
}

Map random_map(Random& random, int step) {
  Map map(MapHeader{.frame = {}, .types = TypeTable({kConditional}), .metadata = {}, .history = {}});
  for (int i = 0; i < 6; ++i) {
    const PatchIndex index{static_cast<std::int32_t>(random() % 3) - 1,
                           static_cast<std::int32_t>(random() % 3)};
    map.layer(index, 0, step) = test::random_occupancy(step, random);
  }
  return map;
}

TEST(FuseMaps, DoesNotDependOnTheOrder) {
  Random random(63);
  const Map a = random_map(random, 4), b = random_map(random, 3), c = random_map(random, 4);
  const Map x = fuse_maps(std::array{&a, &b, &c}), y = fuse_maps(std::array{&c, &a, &b});
  ASSERT_EQ(x.size(), y.size());
  for (const auto& [key, patch] : x.by_key()) {
    const Layer* other = y.find(patch.index, 0);
    ASSERT_NE(other, nullptr);
    EXPECT_TRUE(same_cells(patch.layers.at(0), *other));
  }
}

TEST(FuseMaps, EmptyMapIsNeutral) {
  Random random(64);
  const Map a = random_map(random, 4);
  const Map none(a.header());
  const Map out = fuse_maps(std::array{&none, &a});
  ASSERT_EQ(out.size(), a.size());
  for (const auto& [key, patch] : a.by_key()) {
    EXPECT_TRUE(same_cells(patch.layers.at(0), *out.find(patch.index, 0)));
  }
}

TEST(FuseMaps, RefusesOtherFrames) {
  MapHeader header;
  const Map a(header);
  header.frame.datum_x_um = 1;
  const Map b(header);
  EXPECT_THROW(fuse_maps(std::array{&a, &b}), Error);
}

}  // namespace
}  // namespace apgm
