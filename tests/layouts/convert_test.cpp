#include <gtest/gtest.h>

#include <cmath>

#include "apgm/core/error.hpp"
#include "apgm/fuse/regrid.hpp"
#include "apgm/fuse/resample.hpp"
#include "apgm/layouts/moving_grid.hpp"
#include "apgm/layouts/nonuniform_grid.hpp"
#include "apgm/layouts/submap_grid.hpp"
#include "support.hpp"

namespace apgm {
namespace {

using test::Random;

CellSchema schema_of(const Map& map) { return CellSchema(map.header().types); }

/// A random map of 12.8 m patches, cells of 0.1 to 0.8 m, over about 230 m.
Map wide_map(std::uint64_t seed, int min_step = 4, int max_step = 7, Frame frame = {}) {
  test::RandomMapOptions options;
  options.frame = frame;
  options.range = {{-9, -9}, {8, 8}};
  options.fill = 0.5;
  options.min_step = min_step;
  options.max_step = max_step;
  options.types = {LayerType::occupancy(), LayerType::semantic("semantic", {"road", "marking", "blocked"})};
  return test::random_map(seed, options);
}

Layer resampled(const Layer& layer, const LayerType& type, int step) {
  Layer out;
  resample(layer, type, step, out);
  return out;
}

/// Distance from the vehicle in the square metric, of the farthest and the nearest point of a patch.
struct Reach {
  double nearest = 0, farthest = 0;
};
Reach reach(const Frame& frame, PatchIndex patch, Point vehicle) {
  const Box box = frame.box_m(patch);
  const auto far = [](double lo, double hi, double v) {
    return std::max(std::fabs(lo - v), std::fabs(hi - v));
  };
  const auto near = [](double lo, double hi, double v) { return std::max({lo - v, v - hi, 0.0}); };
  return {std::max(near(box.min.x_m, box.max.x_m, vehicle.x_m), near(box.min.y_m, box.max.y_m, vehicle.y_m)),
          std::max(far(box.min.x_m, box.max.x_m, vehicle.x_m), far(box.min.y_m, box.max.y_m, vehicle.y_m))};
}

class BuerkleRoundTrip : public testing::TestWithParam<std::uint64_t> {};

TEST_P(BuerkleRoundTrip, WithAKeepsTheNearAndCoarsensTheFar) {
  const Map map = wide_map(GetParam());
  const TypeTable& types = map.header().types;
  const Frame& frame = map.header().frame;
  Random random(GetParam());
  const Point vehicle{40 * random.unit() - 20, 40 * random.unit() - 20};
  const auto grid = make_nonuniform_grid(schema_of(map), frame, buerkle_preset("A"));
  grid->move_to(vehicle);
  fill(*grid, map);
  const Map back = to_map(*grid, frame);
  int near = 0, middle = 0, far = 0;
  for (const auto& [key, patch] : map.by_key()) {
    const Reach r = reach(frame, patch.index, vehicle);
    for (const auto& [t, layer] : patch.layers) {
      const Layer* out = back.find(patch.index, t);
      // The snapped position is up to 0.2 m away.
      if (r.farthest <= 19.8) {
        ASSERT_NE(out, nullptr);
        EXPECT_EQ(out->step(), 7);
        EXPECT_TRUE(same_cells(*out, resampled(layer, types[t], 7)));
        if (layer.step() < 7) {
          // Merged again, the masses are those of the map up to rounding.
          EXPECT_LE(test::greatest_difference(resampled(*out, types[t], layer.step()), layer), 2e-6);
        }
        ++near;
      } else if (r.nearest >= 20.2 && r.farthest <= 59.8) {
        ASSERT_NE(out, nullptr);
        EXPECT_TRUE(same_cells(*out, resampled(layer, types[t], 6)));
        ++middle;
      } else if (r.nearest >= 60.2 && r.farthest <= 99.8) {
        ASSERT_NE(out, nullptr);
        EXPECT_TRUE(same_cells(*out, resampled(layer, types[t], 5)));
        ++far;
      } else if (r.nearest >= 100.2) {
        EXPECT_EQ(out, nullptr);
      }
    }
  }
  EXPECT_GT(middle, 5);
  EXPECT_GT(far, 20);
  for (const auto& [key, patch] : back.by_key()) EXPECT_NE(map.find(patch.index), nullptr);
  RecordProperty("near", near);
}

TEST_P(BuerkleRoundTrip, OfMapsAtATenthOfAMetreKeepsBitsNearby) {
  const Map map = wide_map(GetParam(), 7, 7);
  const Frame& frame = map.header().frame;
  const auto grid = make_nonuniform_grid(schema_of(map), frame, buerkle_preset("A"));
  fill(*grid, map);
  const Map back = to_map(*grid, frame);
  int cells = 0;
  for (const auto& [key, patch] : map.by_key()) {
    if (reach(frame, patch.index, {0, 0}).nearest >= 20) continue;
    for (const auto& [t, layer] : patch.layers) {
      const Layer* out = back.find(patch.index, t);
      const Box box = frame.box_m(patch.index);
      for (int b = 0; b < 128; ++b) {
        for (int a = 0; a < 128; ++a) {
          const double x = box.min.x_m + 0.1 * a + 0.05, y = box.min.y_m + 0.1 * b + 0.05;
          if (std::max(std::fabs(x), std::fabs(y)) > 20) continue;
          for (int c = 0; c < layer.channels(); ++c) {
            const float want = layer.at(c, {a, b});
            const bool is_vacuous = map.header().types[t].background(c) == want;
            if (out == nullptr || out->step() != 7) {
              // No data of the type within 20 m of the patch.
              ASSERT_TRUE(is_vacuous);
            } else {
              ASSERT_EQ(out->at(c, {a, b}), want);
              ++cells;
            }
          }
        }
      }
    }
  }
  EXPECT_GT(cells, 1000);
}

TEST_P(BuerkleRoundTrip, WithCConservesTheEvidence) {
  Map map = wide_map(GetParam(), 4, 7);
  const Frame& frame = map.header().frame;
  const TypeId occupancy = *map.header().types.find("occupancy");
  const auto lambda = [&](const Map& m) {
    double sum = 0;
    for (const auto& [key, patch] : m.by_key()) {
      const Reach r = reach(frame, patch.index, {0, 0});
      if (r.farthest > 99 || patch.layers.count(occupancy) == 0) continue;
      for (const float o : patch.layers.at(occupancy).plane(0)) {
        sum -= o < 1 ? std::log1p(-static_cast<double>(o)) : 0;
      }
    }
    return sum;
  };
  // A mass of 1 has no finite lambda.
  for (const auto& [key, patch] : map.by_key()) {
    for (const auto& [t, layer] : patch.layers) {
      if (t != occupancy) continue;
      for (float& o : map.layer(patch.index, t, layer.step()).plane(0)) o = std::min(o, 0.875f);
    }
  }
  const auto grid = make_nonuniform_grid(schema_of(map), frame, buerkle_preset("C"));
  fill(*grid, map);
  const Map back = to_map(*grid, frame);
  EXPECT_NEAR(lambda(back) / lambda(map), 1, 2e-4);
  for (const auto& [key, patch] : back.by_key()) {
    for (const auto& [t, layer] : patch.layers) {
      Layer copy = layer;
      EXPECT_NO_THROW(canonicalise(copy, back.header().types[t]));
      EXPECT_TRUE(same_cells(copy, layer));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, BuerkleRoundTrip, testing::Values(21, 22, 23));

TEST(BuerkleC, MergesCellsThatAreNotSquare) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  Map map(header);
  // (2, 0) lies at x 25.6 to 38.4 m: cells of 0.4 x 0.1 m.
  Layer& layer = map.layer({2, 0}, 0, 7);
  layer.at(0, {0, 0}) = 0.5f;
  layer.at(1, {1, 0}) = 0.8f;
  layer.at(1, {2, 0}) = 0.4f;
  layer.at(1, {0, 1}) = 0.8f;
  const auto grid = make_nonuniform_grid(schema_of(map), map.header().frame, buerkle_preset("C"));
  fill(*grid, map);
  const float* cell = grid->find({25.7, 0.05});
  EXPECT_NEAR(cell[0], 0.5, 1e-6);
  EXPECT_NEAR(cell[1], 0.5 * (0.8 + 0.4) / 4, 1e-6);
  EXPECT_NEAR(grid->find({25.7, 0.15})[1], 0.2, 1e-6);
  const Map back = to_map(*grid, map.header().frame);
  const Layer* out = back.find({2, 0}, 0);
  ASSERT_NE(out, nullptr);
  EXPECT_EQ(out->step(), 7);
  for (int a = 0; a < 4; ++a) {
    EXPECT_NEAR(out->at(0, {a, 0}), 1 - std::pow(0.5, 0.25), 1e-6);
    EXPECT_NEAR(out->at(1, {a, 1}), 0.2, 1e-6);
  }
  EXPECT_EQ(out->at(1, {4, 1}), 0.0f);
}

class SubMapRoundTrip : public testing::TestWithParam<SubMapContainer> {};

TEST_P(SubMapRoundTrip, KeepsEveryBitAtOneResolution) {
  for (const std::uint64_t seed : {31u, 32u, 33u, 34u}) {
    test::RandomMapOptions options;
    options.frame = test::frame_at(573'100'000'000, 5'362'900'123'457);
    options.min_step = options.max_step = 4;
    const Map map = test::random_map(seed, options);
    const auto grid = make_submap_grid(schema_of(map), options.frame, 0.8, GetParam());
    fill(*grid, map);
    EXPECT_EQ(grid->footprint().cells, map.size() * 256) << "the patches of the map and no others";
    EXPECT_EQ(test::difference(map, to_map(*grid, options.frame)), "") << "seed " << seed;
  }
}

TEST_P(SubMapRoundTrip, BringsOtherStepsToTheOneResolution) {
  test::RandomMapOptions options;
  options.min_step = 2;
  options.max_step = 6;
  const Map map = test::random_map(35, options);
  const auto grid = make_submap_grid(schema_of(map), options.frame, 0.8, GetParam());
  fill(*grid, map);
  const Map back = to_map(*grid, options.frame);
  ASSERT_EQ(back.size(), map.size());
  for (const auto& [key, patch] : map.by_key()) {
    for (const auto& [t, layer] : patch.layers) {
      EXPECT_TRUE(same_cells(*back.find(patch.index, t), resampled(layer, map.header().types[t], 4)));
    }
  }
}

TEST_P(SubMapRoundTrip, OtherFramesAreGatheredByArea) {
  test::RandomMapOptions options;
  options.min_step = options.max_step = 4;
  const Map map = test::random_map(36, options);
  const Frame other = test::frame_at(333'333, -77'777, 10'000'000);
  const auto grid = make_submap_grid(schema_of(map), other, 0.625, GetParam());
  fill(*grid, map);
  const auto direct = regrid(map, other, {}, 4);
  Layer want;
  const auto cursor = direct->patches();
  PatchInfo info;
  const Map back = to_map(*grid, other);
  while (cursor->next(info)) {
    for (const LayerInfo& layer : info.layers) {
      direct->load(layer, want);
      const Layer* out = back.find(info.patch, layer.type);
      if (out == nullptr) {
        EXPECT_TRUE(is_vacuous(want, map.header().types[layer.type]));
      } else {
        EXPECT_LE(test::greatest_difference(*out, want), 0);
      }
    }
  }
}

std::string name_of(const testing::TestParamInfo<SubMapContainer>& info) {
  return std::string(to_string(info.param));
}
INSTANTIATE_TEST_SUITE_P(All, SubMapRoundTrip, testing::ValuesIn(kSubMapContainers), name_of);

TEST(MovingGridRoundTrip, KeepsBitsInsideAndLosesTheRest) {
  const Map map = wide_map(41, 6, 6);
  const Frame& frame = map.header().frame;
  const auto grid = make_moving_grid(schema_of(map), frame, 0.2, 30);
  grid->move_to({7, -3});
  fill(*grid, map);
  const Map back = to_map(*grid, frame);
  int inside = 0;
  for (const auto& [key, patch] : map.by_key()) {
    const Reach r = reach(frame, patch.index, {7, -3});
    for (const auto& [t, layer] : patch.layers) {
      const Layer* out = back.find(patch.index, t);
      if (r.farthest < 29.8) {
        ASSERT_NE(out, nullptr);
        EXPECT_TRUE(same_cells(*out, layer));
        ++inside;
      } else if (r.nearest > 30.2) {
        EXPECT_EQ(out, nullptr);
      }
    }
  }
  EXPECT_GT(inside, 0);
}

TEST(Fill, KeepsWhatTheMapDoesNotKnow) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy(), LayerType::real("height", {"z"})});
  Map map(header);
  map.layer({0, 0}, 1, 4).at(0, {0, 0}) = 0.5f;
  const auto grid = make_moving_grid(schema_of(map), Frame{}, 0.8, 8);
  const int first = grid->schema().first(1);
  grid->insert({1, 0})[first] = 0.25f;
  grid->insert({0, 0})[grid->schema().first(0)] = 7.0f;
  fill(*grid, map);
  EXPECT_EQ(grid->find({1, 0})[first], 0.25f);
  EXPECT_EQ(grid->find({0, 0})[first], 0.5f);
  EXPECT_EQ(grid->find({0, 0})[grid->schema().first(0)], 7.0f);
}

TEST(Fill, NeedsTheTypesOfTheMap) {
  const Map map = wide_map(51, 3, 3);
  const auto grid = make_moving_grid(CellSchema(TypeTable({LayerType::occupancy()})), Frame{}, 0.8, 8);
  EXPECT_THROW(fill(*grid, map), Error);
}

TEST(ToMap, RefusesFramesThatCutCells) {
  const auto grid = make_moving_grid(CellSchema(test::paper_types()), Frame{}, 0.3, 3);
  EXPECT_THROW(to_map(*grid, Frame{}), Error);
  EXPECT_NO_THROW(to_map(*grid, test::frame_at(0, 0, 1'200'000)));
  EXPECT_THROW(to_map(*grid, test::frame_at(100'000, 0, 1'200'000)), Error);
  EXPECT_THROW(to_map(*grid, test::frame_at(0, 0, 150'000)), Error);
}

}  // namespace
}  // namespace apgm
