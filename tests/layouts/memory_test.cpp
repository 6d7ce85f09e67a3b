#include "apgm/layouts/memory.hpp"

#include <gtest/gtest.h>

#include <array>

#include "apgm/core/error.hpp"
#include "support.hpp"

namespace apgm {
namespace {

// Cells of the paper's drive (Sec. V, means): 243k while parking; 345k of occupancy and 88k of semantics on
// the road. Fixed layouts store 6 values a cell.
constexpr std::array kParking{CellCount{243'000, 2}};
constexpr std::array kRoad{CellCount{345'000, 2}, CellCount{88'000, 4}};

TEST(MemoryFactor, OfThePaper) {
  EXPECT_NEAR(memory_factor({640'000, 6}, kParking), 7.90, 0.005);
  EXPECT_NEAR(memory_factor({640'000, 6}, kRoad), 3.69, 0.005);
  EXPECT_NEAR(memory_factor({243'000, 6}, kParking), 3.00, 0.005);
  EXPECT_NEAR(memory_factor({cells_at_finer_step(345'000, 1), 6}, kRoad), 7.95, 0.005);
}

TEST(MemoryFactor, NeedsSomethingToCompareWith) {
  EXPECT_THROW(memory_factor({1, 1}, {}), Error);
  EXPECT_EQ(cells_at_finer_step(64, -2), 4);
}

TEST(MapFootprint, CountsCellsOfAllLayers) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy(), LayerType::real("height", {"z"})});
  Map map(header);
  EXPECT_EQ(footprint(map).allocated_bytes, 0u);
  map.layer({0, 0}, 0, 3).plane(0)[5] = 0.25f;
  map.layer({0, 0}, 0, 3).plane(0)[6] = 1.0f;
  map.layer({4, 0}, 0, 2).plane(0)[0] = 0.25f;  // types are sorted by name: 0 is the height
  map.layer({4, 0}, 1, 2).plane(0)[0] = 0.25f;
  const Footprint f = footprint(map);
  EXPECT_EQ(f.cells, 64u + 16 + 16);
  EXPECT_EQ(f.values, 64u + 16 + 2 * 16);
  EXPECT_EQ(f.known_cells, 4u);
  EXPECT_GT(f.allocated_bytes, f.value_bytes());
  EXPECT_NEAR(f.fill_rate(), 4.0 / 96, 1e-12);
}

}  // namespace
}  // namespace apgm
