#include "apgm/ops/render.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <limits>
#include <random>

#include "render_support.hpp"

namespace apgm {

namespace {

using namespace test;

std::uint64_t fnv1a(const std::vector<std::uint8_t>& bytes) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const std::uint8_t b : bytes) hash = (hash ^ b) * 0x100000001b3u;
  return hash;
}

// Random occupancy of several steps, most of it free, sparse in the large.
Map random_map(std::uint32_t seed, int patches, int most_step) {
  std::mt19937 random(seed);
  const auto below = [&](int n) { return static_cast<int>(random() % static_cast<std::uint32_t>(n)); };
  Map map = occupancy_map();
  for (int i = 0; i < patches; ++i) {
    const PatchIndex index{below(40) - 20, below(40) - 20};
    Layer& layer = map.layer(index, 0, below(most_step + 1));
    for (int n = 0; n < 20; ++n) {
      const CellIndex cell{below(layer.side()), below(layer.side())};
      const float mass = static_cast<float>(below(1000)) / 1000.0f;
      layer.at(below(4) == 0 ? 0 : 1, cell) = 0.5f * mass;
    }
  }
  return map;
}

TEST(RenderTest, PutsCellsWhereTheyLieWithYUp) {
  Map map = occupancy_map();
  occupy(map, {0, 0}, 3, {0, 0});
  release(map, {0, 0}, 3, {7, 0});
  occupy(map, {0, 0}, 3, {2, 7});
  const Rendering r = render(map, {});
  ASSERT_EQ(r.raster.width, 8);
  ASSERT_EQ(r.raster.height, 8);
  EXPECT_EQ(r.raster.at(0, 7), kOccupied);
  EXPECT_EQ(r.raster.at(7, 7), kFree);
  EXPECT_EQ(r.raster.at(2, 0), kOccupied);
  EXPECT_EQ(r.raster.at(4, 4), kUnknown);
  EXPECT_DOUBLE_EQ(r.pixel_m, 1.6);
  EXPECT_EQ(r.area, (Box{{0, 0}, {12.8, 12.8}}));
  EXPECT_EQ(r.layers, 1u);
}

TEST(RenderTest, PutsPatchesWhereTheyLie) {
  Map map = occupancy_map();
  occupy(map, {-2, -1}, 1, {0, 0});
  occupy(map, {1, 2}, 1, {1, 1});
  const Rendering r = render(map, {});
  ASSERT_EQ(r.raster.width, 8);
  ASSERT_EQ(r.raster.height, 8);
  for (int row = 0; row < 8; ++row) {
    for (int column = 0; column < 8; ++column) {
      const bool occupied = (row == 7 && column == 0) || (row == 0 && column == 7);
      EXPECT_EQ(r.raster.at(column, row), occupied ? kOccupied : kUnknown) << column << "," << row;
    }
  }
  EXPECT_DOUBLE_EQ(r.area.min.x_m, -25.6);
  EXPECT_DOUBLE_EQ(r.area.min.y_m, -12.8);
  EXPECT_DOUBLE_EQ(r.area.max.x_m, 25.6);
  EXPECT_DOUBLE_EQ(r.area.max.y_m, 38.4);
}

TEST(RenderTest, DrawsCoarseLayersAsSquaresBesideFineOnes) {
  Map map = occupancy_map();
  occupy(map, {0, 0}, 1, {1, 0});
  occupy(map, {1, 0}, 3, {0, 0});
  const Rendering r = render(map, {});
  ASSERT_EQ(r.raster.width, 16);
  ASSERT_EQ(r.raster.height, 8);
  for (int row = 0; row < 8; ++row) {
    for (int column = 0; column < 8; ++column) {
      EXPECT_EQ(r.raster.at(column, row), column >= 4 && row >= 4 ? kOccupied : kUnknown);
    }
  }
  EXPECT_EQ(r.raster.at(8, 7), kOccupied);
  EXPECT_EQ(r.raster.at(9, 7), kUnknown);
}

TEST(RenderTest, EnlargesCellsByWholeNumbers) {
  Map map = occupancy_map();
  occupy(map, {0, 0}, 2, {1, 2});
  RenderOptions options;
  options.pixel_m = 3.2 / 3;
  const Rendering r = render(map, options);
  ASSERT_EQ(r.raster.width, 12);
  for (int row = 0; row < 12; ++row) {
    for (int column = 0; column < 12; ++column) {
      const bool inside = column >= 3 && column < 6 && row >= 3 && row < 6;
      EXPECT_EQ(r.raster.at(column, row), inside ? kOccupied : kUnknown) << column << "," << row;
    }
  }
}

TEST(RenderTest, TakesThePixelSizeDownToOneThatFits) {
  Map map = occupancy_map();
  occupy(map, {0, 0}, 7, {0, 0});
  const auto pixel_m = [&](double asked_m) {
    RenderOptions options;
    options.pixel_m = asked_m;
    return render(map, options).pixel_m;
  };
  EXPECT_DOUBLE_EQ(pixel_m(0.1), 0.1);
  EXPECT_DOUBLE_EQ(pixel_m(0.15), 0.1);
  EXPECT_DOUBLE_EQ(pixel_m(0.2), 0.2);
  EXPECT_DOUBLE_EQ(pixel_m(0.3999), 0.2);
  EXPECT_DOUBLE_EQ(pixel_m(0.07), 0.05);
  EXPECT_DOUBLE_EQ(pixel_m(0.1 / 3), 0.1 / 3);
  EXPECT_DOUBLE_EQ(pixel_m(30), 25.6);
}

TEST(RenderTest, ChoosesThePixelSizeByTheLongerSide) {
  Map map = occupancy_map();
  occupy(map, {0, 0}, 7, {0, 0});
  occupy(map, {9, 0}, 5, {0, 0});
  RenderOptions options;
  options.max_side = 1280;
  EXPECT_DOUBLE_EQ(render(map, options).pixel_m, 0.1);
  options.max_side = 1279;
  EXPECT_DOUBLE_EQ(render(map, options).pixel_m, 0.2);
  options.max_side = 1;
  const Rendering r = render(map, options);
  EXPECT_DOUBLE_EQ(r.pixel_m, 12.8 * 16);
  EXPECT_EQ(r.raster.width, 1);
  EXPECT_EQ(r.raster.height, 1);
}

TEST(RenderTest, NoObstacleVanishesHoweverSmallThePicture) {
  for (const Policy policy : {Policy::kConditional, Policy::kExclusive, Policy::kMin, Policy::kProduct}) {
    Map map = occupancy_map(policy);
    for (int y = 0; y < 4; ++y) {
      for (int x = 0; x < 4; ++x) {
        for (float& free : map.layer({x, y}, 0, 6).plane(1)) free = 0.9f;
      }
    }
    Layer& layer = map.layer({2, 1}, 0, 6);
    layer.at(0, {13, 50}) = 1.0f;
    layer.at(1, {13, 50}) = 0.0f;
    for (double pixel_m = 0.2; pixel_m < 60; pixel_m *= 2) {
      RenderOptions options;
      options.pixel_m = pixel_m;
      const Rendering r = render(map, options);
      const double x_m = 2 * 12.8 + 13.5 * 0.2, y_m = 12.8 + 50.5 * 0.2;
      const int column = static_cast<int>(x_m / r.pixel_m);
      const int row = r.raster.height - 1 - static_cast<int>(y_m / r.pixel_m);
      EXPECT_EQ(r.raster.at(column, row), kOccupied) << to_string(policy) << " at " << r.pixel_m;
      int dark = 0;
      for (int i = 0; i < r.raster.width * r.raster.height; ++i) {
        dark += r.raster.at(i % r.raster.width, i / r.raster.width) == kOccupied ? 1 : 0;
      }
      EXPECT_EQ(dark, 1) << to_string(policy) << " at " << r.pixel_m;
    }
  }
}

TEST(RenderTest, MergesPatchesThatLieFarApart) {
  Map map = occupancy_map();
  occupy(map, {-2'000'000'000, -2'000'000'000}, 4, {3, 3});
  occupy(map, {2'000'000'000, 2'000'000'000}, 4, {3, 3});
  const Rendering r = render(map, {});
  EXPECT_LE(r.raster.width, 2048);
  EXPECT_EQ(r.raster.at(0, r.raster.height - 1), kOccupied);
  EXPECT_EQ(r.raster.at(r.raster.width - 1, 0), kOccupied);
  EXPECT_EQ(r.raster.at(r.raster.width / 2, r.raster.height / 2), kUnknown);
}

TEST(RenderTest, SnapsTheAreaOutwardsToPixels) {
  Map map = occupancy_map();
  for (float& occupied : map.layer({0, 0}, 0, 7).plane(0)) occupied = 1.0f;
  RenderOptions options;
  options.area = Box{{-0.05, 0.3}, {0.55, 0.6}};
  const Rendering r = render(map, options);
  ASSERT_EQ(r.raster.width, 7);
  ASSERT_EQ(r.raster.height, 3);
  for (int row = 0; row < 3; ++row) {
    EXPECT_EQ(r.raster.at(0, row), kUnknown);
    for (int column = 1; column < 7; ++column) EXPECT_EQ(r.raster.at(column, row), kOccupied);
  }
  EXPECT_NEAR(r.area.min.x_m, -0.1, 1e-9);
  EXPECT_NEAR(r.area.min.y_m, 0.3, 1e-9);
  EXPECT_NEAR(r.area.max.x_m, 0.6, 1e-9);
  EXPECT_NEAR(r.area.max.y_m, 0.6, 1e-9);
}

TEST(RenderTest, AreaIsACutOutOfTheWholePicture) {
  const Map map = random_map(7, 60, 5);
  for (const double pixel_m : {0.4, 0.2, 0.8, 12.8, 25.6}) {
    RenderOptions options;
    options.pixel_m = pixel_m;
    const Rendering whole = render(map, options);
    options.area = Box{{-90, -51.2}, {64, 77}};
    const Rendering part = render(map, options);
    const auto pixels = [&](double metres) { return static_cast<int>(std::lround(metres / pixel_m)); };
    const int dx = pixels(part.area.min.x_m - whole.area.min.x_m);
    const int dy = pixels(whole.area.max.y_m - part.area.max.y_m);
    for (int row = 0; row < part.raster.height; ++row) {
      for (int column = 0; column < part.raster.width; ++column) {
        ASSERT_EQ(part.raster.at(column, row), whole.raster.at(column + dx, row + dy)) << pixel_m;
      }
    }
  }
}

TEST(RenderTest, AreaOutsideTheMapIsUnknown) {
  Map map = occupancy_map();
  occupy(map, {0, 0}, 3, {0, 0});
  RenderOptions options;
  options.area = Box{{100, 100}, {110, 104}};
  const Rendering r = render(map, options);
  EXPECT_EQ(r.layers, 0u);
  ASSERT_FALSE(r.raster.empty());
  EXPECT_EQ(r.raster.at(0, 0), kUnknown);
}

TEST(RenderTest, ListsTheSquaresOfDrawnPatches) {
  Map map = occupancy_map();
  occupy(map, {0, 0}, 4, {0, 0});
  occupy(map, {2, 1}, 4, {0, 0});
  const Rendering r = render(map, {});
  EXPECT_EQ(r.patch_px, 16);
  ASSERT_EQ(r.patches.size(), 2u);
  EXPECT_EQ(r.patches[0], (Rendering::Square{0, 16}));
  EXPECT_EQ(r.patches[1], (Rendering::Square{32, 0}));
  RenderOptions options;
  options.min_patch_px = 17;
  const Rendering none = render(map, options);
  EXPECT_EQ(none.patch_px, 0);
  EXPECT_TRUE(none.patches.empty());
}

TEST(RenderTest, EmptyMapGivesAnEmptyRasterWithLegend) {
  const Map map = occupancy_map();
  const Rendering r = render(map, {});
  EXPECT_TRUE(r.raster.empty());
  EXPECT_EQ(r.layers, 0u);
  EXPECT_EQ(r.legend.entries.size(), 3u);
}

TEST(RenderTest, DrawsTheAskedLayerOnly) {
  Map map(header_of({LayerType::occupancy("a"), LayerType::occupancy("b")}));
  map.layer({0, 0}, 0, 2).at(0, {0, 0}) = 1.0f;
  map.layer({1, 0}, 1, 3).at(0, {0, 0}) = 1.0f;
  RenderOptions options;
  options.type = 1;
  const Rendering r = render(map, options);
  EXPECT_EQ(r.raster.width, 16);
  EXPECT_EQ(r.raster.at(0, 7), kUnknown);
  EXPECT_EQ(r.raster.at(8, 7), kOccupied);
}

TEST(RenderLimitTest, RefusesWhatCannotBeUsed) {
  Map map = occupancy_map();
  occupy(map, {0, 0}, 7, {0, 0});
  const auto code = [&](const auto& change) {
    RenderOptions options;
    change(options);
    return code_of([&] { (void)render(map, options); });
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  using O = RenderOptions;
  EXPECT_EQ(code([](O& o) { o.type = 1; }), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code([](O& o) { o.channel = 2; }), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code([](O& o) { o.channel = -1; }), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code([](O& o) { o.max_side = 0; }), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code([](O& o) { o.pixel_m = 0; }), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code([](O& o) { o.pixel_m = -1; }), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code([&](O& o) { o.pixel_m = nan; }), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code([](O& o) { o.area = Box{{1, 0}, {0, 1}}; }), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code([&](O& o) { o.area = Box{{nan, 0}, {1, 1}}; }), ErrorCode::kInvalidArgument);
}

TEST(RenderLimitTest, RefusesTooManyPixelsBeforeAllocating) {
  Map map = occupancy_map();
  occupy(map, {0, 0}, 7, {0, 0});
  occupy(map, {2'000'000'000, 2'000'000'000}, 7, {0, 0});
  const auto code = [&](double pixel_m, std::optional<Box> area = {}) {
    RenderOptions options;
    options.pixel_m = pixel_m;
    options.area = area;
    return code_of([&] { (void)render(map, options); });
  };
  EXPECT_EQ(code(0.1), ErrorCode::kLimit);
  EXPECT_EQ(code(1e-9), ErrorCode::kLimit);
  EXPECT_EQ(code(1e-300), ErrorCode::kLimit);
  EXPECT_EQ(code(0.1, Box{{0, 0}, {7000, 0.1}}), ErrorCode::kLimit);
  EXPECT_EQ(code(0.1, Box{{-1e300, -1e300}, {1e300, 1e300}}), ErrorCode::kLimit);
  RenderOptions options;
  options.max_pixels = 128 * 128 - 1;
  options.area = Box{{0, 0}, {12.8, 12.8}};
  EXPECT_EQ(code_of([&] { (void)render(map, options); }), ErrorCode::kLimit);
  ++options.max_pixels;
  EXPECT_EQ(render(map, options).raster.width, 128);
}

TEST(RenderLimitTest, KeepsToTheMemoryBudget) {
  Map map = occupancy_map();
  occupy(map, {0, 0}, 7, {0, 0});
  RunOptions run;
  run.max_memory_bytes = 128 * 128 * 4 - 1;
  EXPECT_EQ(code_of([&] { (void)render(map, {}, run); }), ErrorCode::kLimit);
  run.max_memory_bytes = std::uint64_t{64} << 20;
  EXPECT_EQ(render(map, {}, run).raster.width, 128);
}

TEST(RenderTest, CanBeCancelled) {
  const Map map = random_map(1, 20, 3);
  const std::atomic<bool> cancel = true;
  RunOptions run;
  run.cancel = &cancel;
  EXPECT_EQ(code_of([&] { (void)render(map, {}, run); }), ErrorCode::kCancelled);
}

TEST(RenderTest, SamePixelsForAnyThreadCount) {
  for (std::uint32_t seed = 0; seed < 5; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Map map = random_map(seed, 200, 5);
    for (const double pixel_m : {0.2, 0.4, 3.2, 51.2}) {
      RenderOptions options;
      options.pixel_m = pixel_m;
      RunOptions run;
      run.threads = 1;
      const Rendering one = render(map, options, run);
      for (const int threads : {2, 5}) {
        run.threads = threads;
        const Rendering many = render(map, options, run);
        EXPECT_EQ(one.raster.rgba, many.raster.rgba);
        EXPECT_EQ(one.patches, many.patches);
      }
    }
  }
}

TEST(RenderTest, PixelsAreThoseOfTheFrozenPictures) {
  const Map map = random_map(42, 100, 5);
  const auto hash = [&](double pixel_m, Colormap colormap) {
    RenderOptions options;
    options.pixel_m = pixel_m;
    options.colormap = colormap;
    return fnv1a(render(map, options).raster.rgba);
  };
  EXPECT_EQ(hash(0.4, Colormap::kBelief), 13000297316451244280u);
  EXPECT_EQ(hash(1.6, Colormap::kEvidence), 5523900530039854902u);
  EXPECT_EQ(hash(25.6, Colormap::kGrey), 11623471585546326594u);
}

}  // namespace
}  // namespace apgm
