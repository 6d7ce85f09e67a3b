#include "libapgm/src/ops/shifted_source.hpp"

#include <gtest/gtest.h>

#include "apgm/ops/copy.hpp"
#include "random_map.hpp"
#include "stored_map.hpp"

namespace apgm::ops {
namespace {

using test::difference;

Map shifted(const PatchSource& source, const Frame& target, int step) {
  const auto offset = whole_cells(source.header().frame, target, step);
  EXPECT_TRUE(offset);
  const ShiftedSource view(source, target, *offset);
  Map out(view.header());
  MapSink sink(out);
  copy(view, out.header().types, sink, false);
  return out;
}

TEST(WholeCells, AsksExactly) {
  Frame a, b;
  b.datum_x_um = 6'400'000;
  EXPECT_FALSE(whole_cells(a, b, 0));
  ASSERT_TRUE(whole_cells(a, b, 1));
  EXPECT_EQ(whole_cells(a, b, 1)->x, -1);
  EXPECT_EQ(whole_cells(b, a, 3)->x, 4);
  // 12.8 m / 2^11 = 6250 um; a cell of 1 m / 2^11 is no whole number of micrometres, 64 of them are.
  a.edge_um = b.edge_um = 1'000'000;
  b.datum_x_um = 31'250;
  EXPECT_EQ(whole_cells(b, a, 11)->x, 64);
  b.datum_x_um = 31'251;
  EXPECT_FALSE(whole_cells(b, a, 11));
}

TEST(ShiftedSource, ThereAndBackIsTheIdentity) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE(seed);
    test::Random random(seed);
    test::RandomMapOptions options;
    options.min_step = options.max_step = random.in(0, 5);
    const Map map = test::random_map(seed, options);
    Frame target = options.frame;
    const std::int64_t cell_um = target.edge_um >> options.min_step;
    target.datum_x_um = random.in(-70, 70) * cell_um;
    target.datum_y_um = random.in(-70, 70) * cell_um;
    const Map there = shifted(map, target, options.min_step);
    EXPECT_TRUE(there.header().frame == target);
    const Map back = shifted(there, options.frame, options.min_step);
    EXPECT_EQ(difference(map, back, false), "");
  }
}

TEST(ShiftedSource, ByWholePatchesKeepsMixedStepsAndStamps) {
  const Map map = test::random_map(3);
  Frame target;
  target.datum_x_um = 7 * target.edge_um;
  target.datum_y_um = -4 * target.edge_um;
  EXPECT_EQ(difference(map, shifted(shifted(map, target, 0), Frame{}, 0), true), "");
}

TEST(ShiftedSource, ComesInKeyOrderAndSumsUp) {
  const Map map = test::random_map(4);
  Frame target;
  target.datum_x_um = 6'400'000;
  target.datum_y_um = 3 * 6'400'000;
  const ShiftedSource view(map, target, *whole_cells(Frame{}, target, 1));
  const auto cursor = view.patches();
  PatchInfo patch;
  std::uint64_t last = 0, patches = 0, layers = 0;
  PatchRange range;
  while (cursor->next(patch)) {
    EXPECT_TRUE(patches == 0 || curve_key(patch.patch) > last);
    last = curve_key(patch.patch);
    ++patches;
    layers += patch.layers.size();
    range.add(patch.patch);
    EXPECT_TRUE(std::ranges::is_sorted(patch.layers, {}, &LayerInfo::type));
    EXPECT_FALSE(patch.layers.empty());
  }
  const Summary summary = view.summary();
  EXPECT_GT(patches, map.size());
  EXPECT_EQ(summary.patches, patches);
  EXPECT_EQ(summary.range, range);
  std::uint64_t sum = 0;
  for (const auto& type : summary.types) sum += type.layers;
  EXPECT_EQ(sum, layers);
}

TEST(ShiftedSource, SplitsCoarserLayersBesideFinerOnes) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  Map map(header);
  map.layer({0, 0}, 0, 1).at(1, {1, 0}) = 0.5f;
  map.layer({1, 0}, 0, 2).at(0, {0, 0}) = 0.75f;
  Frame target;
  target.datum_x_um = target.edge_um / 2;  // cells move half a patch to the left
  const Map out = shifted(map, target, 1);
  const Layer* layer = out.find({0, 0}, 0);
  ASSERT_NE(layer, nullptr);
  EXPECT_EQ(layer->step(), 2);
  EXPECT_EQ(layer->at(1, {0, 0}), 0.5f);
  EXPECT_EQ(layer->at(1, {1, 1}), 0.5f);
  EXPECT_EQ(layer->at(1, {2, 0}), 0.0f);
  EXPECT_EQ(layer->at(0, {2, 0}), 0.75f);
}

TEST(ShiftedSource, RefusesIndicesBeyondTheirRange) {
  MapHeader header;
  header.frame.edge_um = 1000;
  header.types = TypeTable({LayerType::occupancy()});
  Map map(header);
  map.layer({2'000'000'000, 0}, 0, 0).at(0, {0, 0}) = 0.5f;
  Frame target = header.frame;
  target.datum_x_um = -1'000'000'000'000;
  const ShiftedSource view(map, target, *whole_cells(header.frame, target, 0));
  EXPECT_THROW(view.patches(), Error);
}

}  // namespace
}  // namespace apgm::ops
