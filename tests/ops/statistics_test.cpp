#include "apgm/ops/statistics.hpp"

#include <gtest/gtest.h>

#include "random_map.hpp"

namespace apgm {
namespace {

TEST(Statistics, CountsAHandMadeMap) {
  MapHeader header;
  header.types =
      TypeTable({LayerType::occupancy(), LayerType::semantic("s", {"a", "b"}), LayerType::real("z", {"z"})});
  Map map(header);
  const TypeId occupancy = 0, semantic = 1, height = 2;
  Layer& o = map.layer({0, 0}, occupancy, 1);
  o.at(0, {0, 0}) = 0.75f;
  o.at(1, {0, 0}) = 0.125f;
  o.at(1, {1, 0}) = 0.5f;
  o.at(0, {0, 1}) = 0.25f;  // BetP = 0.5: neither
  o.at(1, {0, 1}) = 0.25f;
  Layer& s = map.layer({3, 0}, semantic, 0);
  s.at(0, {0, 0}) = 0.5f;
  s.at(1, {0, 0}) = 0.25f;
  s.at(2, {0, 0}) = 0.25f;
  map.layer({3, 0}, height, 2).at(0, {1, 1}) = -3;
  const auto counts = statistics(map);
  ASSERT_EQ(counts.size(), 3u);
  EXPECT_EQ(counts[0].cells, 4u);
  EXPECT_EQ(counts[0].known_cells, 3u);
  EXPECT_EQ(counts[0].occupied_cells, 1u);
  EXPECT_EQ(counts[0].free_cells, 1u);
  EXPECT_EQ(counts[0].max_mass_sum, 0.875);
  EXPECT_EQ(counts[1].cells, 1u);
  EXPECT_EQ(counts[1].known_cells, 1u);
  EXPECT_EQ(counts[1].max_mass_sum, 0.75);
  EXPECT_EQ(counts[2].cells, 16u);
  EXPECT_EQ(counts[2].known_cells, 1u);
  EXPECT_EQ(counts[2].max_mass_sum, 0);
}

TEST(Statistics, IsTheSameForAnyThreadCount) {
  const Map map = test::random_map(8);
  RunOptions one, two;
  one.threads = 1;
  two.threads = 2;
  const auto a = statistics(map, one), b = statistics(map, two);
  const Summary summary = map.summary();
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t t = 0; t < a.size(); ++t) {
    EXPECT_EQ(a[t].known_cells, b[t].known_cells);
    EXPECT_EQ(a[t].occupied_cells, b[t].occupied_cells);
    EXPECT_EQ(a[t].free_cells, b[t].free_cells);
    EXPECT_EQ(a[t].max_mass_sum, b[t].max_mass_sum);
    const std::size_t channels = map.header().types[static_cast<TypeId>(t)].channels.size();
    EXPECT_EQ(a[t].cells * channels * 4, summary.types[t].raw_bytes);
  }
}

TEST(Statistics, OfAnEmptyMapIsZero) {
  const Map map(MapHeader{{}, TypeTable({LayerType::occupancy()}), {}, {}, 0});
  ASSERT_EQ(statistics(map).size(), 1u);
  EXPECT_EQ(statistics(map)[0].cells, 0u);
}

}  // namespace
}  // namespace apgm
