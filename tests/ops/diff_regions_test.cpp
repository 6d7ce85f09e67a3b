#include "libapgm/src/ops/diff_regions.hpp"

#include <gtest/gtest.h>

#include <functional>

#include "apgm/ops/crop.hpp"
#include "diffs.hpp"

namespace apgm {
namespace {

using test::compare;
using test::one_layer;
using test::same_spaces;

TEST(DiffRegions, AreTightAndSorted) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  const Map a(header);
  Map b(header);
  const auto set = [&](PatchIndex patch, CellIndex cell) { b.layer(patch, 0, 7).at(0, cell) = 0.5f; };
  // Around a corner of four patches: one region.
  set({0, 0}, {127, 127});
  set({-1, -1}, {126, 127});
  set({1, 1}, {0, 0});
  set({1, 1}, {1, 0});
  // Alone.
  set({5, 5}, {0, 0});
  DiffOptions options;
  options.regions = true;
  const DiffReport report = compare(a, b, options);
  ASSERT_EQ(report.regions.size(), 3u);
  const auto near = [](const Box& box, const Box& expected) {
    EXPECT_NEAR(box.min.x_m, expected.min.x_m, 1e-9);
    EXPECT_NEAR(box.min.y_m, expected.min.y_m, 1e-9);
    EXPECT_NEAR(box.max.x_m, expected.max.x_m, 1e-9);
    EXPECT_NEAR(box.max.y_m, expected.max.y_m, 1e-9);
  };
  near(report.regions[0].box, {{12.7, 12.7}, {13.0, 12.9}});
  EXPECT_NEAR(report.regions[0].area_m2, 0.03, 1e-12);
  near(report.regions[1].box, {{-0.2, -0.1}, {-0.1, 0.0}});
  near(report.regions[2].box, {{64.0, 64.0}, {64.1, 64.1}});
}

TEST(DiffRegions, HoldAllThatChanged) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    const Map a = test::random_map(seed), b = test::edited_map(a, seed + 400, same_spaces());
    DiffOptions options;
    options.regions = true;
    options.layers = {"occupancy"};
    const DiffReport whole = compare(a, b, options);
    double area = 0;
    for (const DiffRegion& region : whole.regions) {
      area += region.area_m2;
      // Layers of two steps may be of one in the cut, so areas may differ; the change does not get lost.
      CropRegion box;
      box.box = region.box;
      Map cut_a(a.header()), cut_b(b.header());
      MapSink sink_a(cut_a), sink_b(cut_b);
      crop(a, box, {}, sink_a);
      crop(b, box, {}, sink_b);
      EXPECT_TRUE(compare(cut_a, cut_b, options).different);
    }
    EXPECT_NEAR(area, whole.types[0].changed.area_m2, 1e-6);
    EXPECT_TRUE(std::ranges::is_sorted(whole.regions, std::greater<>(), &DiffRegion::area_m2));
  }
}

TEST(DiffRegions, MemoryIsBoundedByCoarserBlocks) {
  ops::RegionFinder fine, tight(64);
  ops::PatchBlocks blocks;
  for (std::int32_t i = 0; i < 8; i += 2) blocks.add({i * 16 + 1, 0}, 7);
  for (std::int32_t x = 0; x < 64; ++x) {
    fine.add({x * 2, 0}, blocks);
    tight.add({x * 2, 0}, blocks);
  }
  EXPECT_EQ(fine.regions({}).size(), 256u);
  const auto coarse = tight.regions({});
  EXPECT_EQ(coarse.size(), 64u);
  double area = 0;
  for (const DiffRegion& region : coarse) area += region.area_m2;
  EXPECT_NEAR(area, 256 * 0.01, 1e-9);
}

TEST(DiffRegions, CellsCoarserThanBlocks) {
  const Map a = one_layer(LayerType::occupancy(), 0, {{0.5f}, {0.0f}});
  const Map b = one_layer(LayerType::occupancy(), 0, {{0.0f}, {0.5f}}, {1, 0});
  DiffOptions options;
  options.regions = true;
  const DiffReport report = compare(a, b, options);
  ASSERT_EQ(report.regions.size(), 1u);
  EXPECT_EQ(report.regions[0].box, (Box{{0, 0}, {25.6, 12.8}}));
  EXPECT_NEAR(report.regions[0].area_m2, 2 * 12.8 * 12.8, 1e-9);
}

}  // namespace
}  // namespace apgm
