#include "apgm/core/map.hpp"

#include <gmock/gmock.h>

#include "apgm/core/error.hpp"

namespace apgm {
namespace {

MapHeader header() {
  MapHeader h;
  h.types = TypeTable({LayerType::occupancy(), LayerType::semantic("semantic", {"Road", "Blocked"})});
  return h;
}

TEST(MapTest, LayersOfAPatchMayHaveDifferentSteps) {
  Map map(header());
  map.layer({1, 0}, 0, 2);
  map.layer({1, 0}, 1, 1);  // the paper's example: l^2_occ and l^1_sem in p_(1,0)
  EXPECT_EQ(map.find({1, 0}, 0)->step(), 2);
  EXPECT_EQ(map.find({1, 0}, 1)->step(), 1);
  EXPECT_EQ(map.layer({1, 0}, 0, 5).step(), 2) << "an existing layer keeps its step";
  EXPECT_EQ(map.find({0, 0}), nullptr);
}

TEST(MapTest, PruneRemovesWhatHoldsNoData) {
  Map map(header());
  map.layer({0, 0}, 0, 3);
  map.layer({1, 0}, 0, 3).plane(0)[0] = 0.5f;
  map.layer({1, 0}, 1, 3);
  map.patch({2, 0});
  map.prune();
  EXPECT_EQ(map.size(), 1u);
  EXPECT_EQ(map.find({1, 0})->layers.size(), 1u);
}

TEST(MapTest, WalksInKeyOrderWhateverTheOrderOfInsertion) {
  Map map(header());
  for (const PatchIndex p : {PatchIndex{5, 5}, PatchIndex{-3, 2}, PatchIndex{0, 0}, PatchIndex{-3, -9}})
    map.layer(p, 0, 0);
  PatchInfo patch;
  const auto cursor = map.patches();
  std::uint64_t last = 0;
  int count = 0;
  while (cursor->next(patch)) {
    EXPECT_TRUE(count == 0 || curve_key(patch.patch) > last);
    last = curve_key(patch.patch);
    ++count;
  }
  EXPECT_EQ(count, 4);
}

TEST(MapTest, SummaryCountsLayersBySteps) {
  Map map(header());
  map.layer({0, 0}, 0, 7);
  map.layer({4, -1}, 0, 6);
  map.layer({4, -1}, 1, 6);
  const Summary s = map.summary();
  EXPECT_EQ(s.patches, 2u);
  EXPECT_EQ(s.range, (PatchRange{{0, -1}, {4, 0}}));
  EXPECT_EQ(s.types[0].layers, 2u);
  EXPECT_EQ(s.types[0].layers_at[7], 1u);
  EXPECT_EQ(s.types[0].raw_bytes, (16'384u + 4'096u) * 2 * 4);
  EXPECT_EQ(s.types[1].raw_bytes, 4'096u * 3 * 4);
}

TEST(MapTest, RefusesAFrameThatCannotBeUsed) {
  MapHeader bad = header();
  bad.frame.edge_um = 0;
  EXPECT_THROW(Map{bad}, Error);
}

TEST(MapSinkTest, TakesPacketsAndDropsTheVacuous) {
  Map map(header());
  MapSink sink(map);
  std::vector<Parcel> parcels(2);
  parcels[0].patch = parcels[1].patch = {2, 3};
  parcels[1].type = 1;
  parcels[0].cells.reset(map.header().types[0], 2);
  parcels[0].cells.plane(1)[5] = 0.5f;
  parcels[0].stamp_ns = 9;
  parcels[1].cells.reset(map.header().types[1], 2);
  for (Parcel& p : parcels) sink.pack(p);
  sink.put({2, 3}, parcels);
  sink.finish();
  ASSERT_NE(map.find({2, 3}, 0), nullptr);
  EXPECT_EQ(map.find({2, 3}, 0)->stamp_ns, 9);
  EXPECT_EQ(map.find({2, 3}, 1), nullptr);
}

}  // namespace
}  // namespace apgm
