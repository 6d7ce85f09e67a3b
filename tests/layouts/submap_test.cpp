#include "apgm/layouts/submap_grid.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "apgm/core/error.hpp"
#include "support.hpp"

namespace apgm {
namespace {

using test::Random;

class SubMapGrid : public testing::TestWithParam<SubMapContainer> {
 protected:
  static std::unique_ptr<Layout> make(double horizon_m = 0, const Frame& frame = {}) {
    return make_submap_grid(CellSchema(test::paper_types()), frame, 1.6, GetParam(), horizon_m);
  }
};

std::set<std::pair<std::int64_t, std::int64_t>> corners(const Layout& layout) {
  std::set<std::pair<std::int64_t, std::int64_t>> out;
  layout.for_each_block([&](const CellBlock& block) { out.insert({block.x_um, block.y_um}); });
  return out;
}

TEST_P(SubMapGrid, GrowsWhereCellsAreInserted) {
  const auto grid = make();
  EXPECT_EQ(grid->name(), "submaps-" + std::string(to_string(GetParam())));
  EXPECT_EQ(grid->footprint().cells, 0u);
  EXPECT_EQ(grid->find({1, 1}), nullptr);
  float* cell = grid->insert({-1, 14});
  ASSERT_NE(cell, nullptr);
  EXPECT_TRUE(test::same_bits(cell, grid->schema().background().data(), 6));
  cell[0] = 0.5f;
  EXPECT_EQ(grid->find({-1.6, 14.3}), cell);
  EXPECT_NE(grid->find({-1.7, 14.3}), cell);
  EXPECT_EQ(grid->find({1, 1}), nullptr);
  const Footprint f = grid->footprint();
  EXPECT_EQ(f.cells, 64u);
  EXPECT_EQ(f.known_cells, 1u);
  EXPECT_EQ(corners(*grid), (decltype(corners(*grid)){{-12'800'000, 12'800'000}}));
}

TEST_P(SubMapGrid, AgreesWithASetOfCellsWhateverIsDone) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    Random random(seed);
    const auto grid = make(60);
    std::map<std::pair<int, int>, std::map<std::pair<int, int>, float>> model;  // sub-map, cell
    for (int i = 0; i < 600; ++i) {
      const int a = random.in(-100, 100), b = random.in(-100, 100);  // cells of 1.6 m
      const std::pair patch{static_cast<int>(std::floor(a / 8.0)), static_cast<int>(std::floor(b / 8.0))};
      const Point p{(a + random.unit()) * 1.6, (b + random.unit()) * 1.6};
      const float value = static_cast<float>(random.unit());
      grid->insert(p)[0] = value;
      model[patch][{a, b}] = value;
      if (i % 50 != 49) continue;
      const Point vehicle{random.in(-100, 100) + 0.25, random.in(-100, 100) + 0.25};
      grid->move_to(vehicle);
      std::erase_if(model, [&](const auto& entry) {
        const auto apart = [](double low, double v) { return std::max({low - v, v - low - 12.8, 0.0}); };
        return std::hypot(apart(entry.first.first * 12.8, vehicle.x_m),
                          apart(entry.first.second * 12.8, vehicle.y_m)) > 60;
      });
      ASSERT_EQ(corners(*grid).size(), model.size()) << "seed " << seed << ", step " << i;
    }
    std::size_t known = 0;
    for (const auto& [patch, cells] : model) {
      for (const auto& [at, value] : cells) {
        const float* cell = grid->find({at.first * 1.6 + 0.8, at.second * 1.6 + 0.8});
        ASSERT_NE(cell, nullptr);
        ASSERT_EQ(cell[0], value);
        known += value != 0;
      }
    }
    EXPECT_EQ(grid->footprint().known_cells, known);
    EXPECT_EQ(grid->footprint().cells, model.size() * 64);
  }
}

TEST_P(SubMapGrid, FindsTheCellsOfItsBlocks) {
  Random random(9);
  const auto grid = make(0, test::frame_at(573'100'000'000, -1));
  const Point d = grid->frame().datum_m();
  for (int i = 0; i < 20; ++i) grid->insert({d.x_m + 200 * random.unit(), d.y_m - 200 * random.unit()});
  grid->for_each_block([&](const CellBlock& block) {
    for (int b = 0; b < block.rows; ++b) {
      for (int a = 0; a < block.columns; ++a) {
        const Point p{static_cast<double>(block.x_um + a * block.cell_x_um + 1) / 1e6,
                      static_cast<double>(block.y_um + b * block.cell_y_um + 1) / 1e6};
        ASSERT_EQ(grid->find(p), block.cells + b * block.row_stride + a * 6);
      }
    }
  });
}

TEST_P(SubMapGrid, SnapshotsAreIndependent) {
  Random random(4);
  const auto grid = make();
  grid->reserve({0, 0, 60'000'000, 30'000'000});
  test::scribble(*grid, random);
  const auto before = test::cells_of(*grid);
  const auto copy = grid->snapshot();
  EXPECT_EQ(test::cells_of(*copy), before);
  grid->insert({3, 3})[0] = 0.875f;
  EXPECT_EQ(test::cells_of(*copy), before);
  copy->insert({20, 3})[1] = 0.125f;
  copy->insert({-20, 3})[1] = 0.125f;
  EXPECT_EQ(grid->find({3, 3})[0], 0.875f);
  EXPECT_EQ(grid->find({20, 3})[1], before.at({19'200'000, 1'600'000})[1]);
  EXPECT_EQ(grid->find({-20, 3}), nullptr);
  copy->edit_blocks({0, 0, 1, 1}, [](const CellBlock&, float* cells) { cells[0] = 0.0625f; });
  EXPECT_EQ(grid->find({0, 0})[0], before.at({0, 0})[0]);
}

TEST_P(SubMapGrid, SharesTilesOnlyWithCopyOnWrite) {
  const auto grid = make();
  grid->insert({0, 0});
  grid->insert({20, 0});
  const auto copy = grid->snapshot();
  const bool is_cow = GetParam() == SubMapContainer::kCowTiles;
  EXPECT_EQ(grid->find({0, 0}) == copy->find({0, 0}), is_cow);
  grid->insert({0, 0});
  EXPECT_NE(grid->find({0, 0}), copy->find({0, 0}));
  EXPECT_EQ(grid->find({20, 0}) == copy->find({20, 0}), is_cow);
}

TEST_P(SubMapGrid, EditsOnlyWhatMeetsTheArea) {
  const auto grid = make();
  grid->reserve({0, 0, 12'800'000 * 5, 12'800'000 * 5});
  std::size_t seen = 0;
  grid->edit_blocks({12'800'000, 0, 12'800'001, 12'800'001}, [&](const CellBlock& block, float*) {
    EXPECT_EQ(block.x_um, 12'800'000);
    ++seen;
  });
  EXPECT_EQ(seen, 2u);
  seen = 0;
  grid->edit_blocks({-1'000'000'000'000, -1'000'000'000'000, 1'000'000'000'000, 1'000'000'000'000},
                    [&](const CellBlock&, float*) { ++seen; });
  EXPECT_EQ(seen, 25u);
  grid->edit_blocks({5, 5, 5, 5}, [&](const CellBlock&, float*) { FAIL(); });
}

TEST_P(SubMapGrid, ReachesFarCorners) {
  const auto grid = make();
  const bool is_dense = GetParam() == SubMapContainer::kDenseArray;
  grid->insert({-1e6, -1e6})[0] = 0.5f;
  if (is_dense) {
    EXPECT_THROW(grid->insert({1e6, 1e6}), Error);
    EXPECT_EQ(grid->footprint().cells, 64u);
  } else {
    grid->insert({3.9e9, 3.9e9})[0] = 0.25f;
    grid->insert({0, -3.9e9});
    EXPECT_EQ(grid->find({3.9e9, 3.9e9})[0], 0.25f);
    EXPECT_EQ(corners(*grid).size(), 3u);
  }
  EXPECT_EQ(grid->find({-1e6, -1e6})[0], 0.5f);
  EXPECT_THROW(grid->insert({5e9, 0}), Error);
  EXPECT_THROW(grid->insert({NAN, 0}), Error);
  EXPECT_THROW(grid->reserve({0, 0, 1'000'000'000'000'000, 1'000'000'000'000'000}), Error);
}

TEST_P(SubMapGrid, IndicesBeyondTheirRangeAreRefused) {
  const auto grid =
      make_submap_grid(CellSchema(test::paper_types()), test::frame_at(0, 0, 1'000), 0.001, GetParam());
  EXPECT_NE(grid->insert({-2'147'483.648, 2'147'483.6475}), nullptr);
  EXPECT_THROW(grid->insert({2'147'483.649, 0}), Error);
  EXPECT_THROW(static_cast<void>(grid->find({2'147'483.649, 0})), Error);
}

std::string name_of(const testing::TestParamInfo<SubMapContainer>& info) {
  return std::string(to_string(info.param));
}
INSTANTIATE_TEST_SUITE_P(All, SubMapGrid, testing::ValuesIn(kSubMapContainers), name_of);

TEST(MakeSubMapGrid, RefusesWhatDoesNotFit) {
  const CellSchema schema(test::paper_types());
  const auto make = [&](double cell_m, double horizon_m = 0) {
    return make_submap_grid(schema, Frame{}, cell_m, SubMapContainer::kHashMap, horizon_m);
  };
  EXPECT_NO_THROW(make(12.8));
  EXPECT_THROW(make(0.3), Error);
  EXPECT_THROW(make(0), Error);
  EXPECT_THROW(make(-0.1), Error);
  EXPECT_THROW(make(25.6), Error);
  EXPECT_THROW(make(0.1, -1), Error);
  EXPECT_THROW(make(0.1, NAN), Error);
}

TEST(SubMapContainers, HaveNames) {
  for (const SubMapContainer c : kSubMapContainers) EXPECT_EQ(submap_container_from(to_string(c)), c);
  EXPECT_EQ(submap_container_from("list"), std::nullopt);
}

}  // namespace
}  // namespace apgm
