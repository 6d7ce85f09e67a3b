#include <gtest/gtest.h>

#include <cmath>

#include "apgm/core/error.hpp"
#include "apgm/fuse/resample.hpp"
#include "apgm/layouts/moving_grid.hpp"
#include "apgm/layouts/nonuniform_grid.hpp"
#include "support.hpp"

namespace apgm {
namespace {

using test::CellMap;
using test::Random;

/// A small layout of A's shape: half extents of 1.6, 4.8 and 8 m.
NonUniformPlan small_plan() {
  NonUniformPlan plan{"small", {{-1.6, 1.6, -1.6, 1.6, 0.1, 0.1}}};
  const auto ring = [&](double in, double out, double cell) {
    plan.rectangles.push_back({-out, out, -out, -in, cell, cell});
    plan.rectangles.push_back({-out, -in, -in, in, cell, cell});
    plan.rectangles.push_back({in, out, -in, in, cell, cell});
    plan.rectangles.push_back({-out, out, in, out, cell, cell});
  };
  ring(1.6, 4.8, 0.2);
  ring(4.8, 8.0, 0.4);
  return plan;
}

Point centre_of(std::pair<std::int64_t, std::int64_t> corner_um) {
  return {static_cast<double>(corner_um.first) / 1e6 + 1e-3,
          static_cast<double>(corner_um.second) / 1e6 + 1e-3};
}

double total_lambda(const CellMap& cells) {
  double sum = 0;
  for (const auto& [at, cell] : cells) sum -= std::log1p(-static_cast<double>(cell[0]));
  return sum;
}

TEST(MovingGrid, KeepsBitsOfWhatStaysAndClearsWhatEnters) {
  const Frame frame = test::frame_at(573'100'000'000, -7'000'001);
  const Point datum = frame.datum_m();
  const auto grid = make_moving_grid(CellSchema(test::paper_types()), frame, 0.2, 3.2);
  EXPECT_EQ(grid->footprint().cells, 32u * 32);
  Random random(5);
  CellMap world;  // what was written where, and never left
  Point vehicle = datum;
  for (int move = 0; move < 60; ++move) {
    test::scribble(*grid, random, 0.1);
    world = test::cells_of(*grid);
    ASSERT_EQ(world.size(), 32u * 32);
    const double reach = move % 10 == 9 ? 20.0 : 1.5;
    vehicle.x_m += reach * (random.unit() - 0.5);
    vehicle.y_m += reach * (random.unit() - 0.5);
    grid->move_to(vehicle);
    const CellMap now = test::cells_of(*grid);
    ASSERT_EQ(now.size(), 32u * 32);
    for (const auto& [at, cell] : now) {
      const auto old = world.find(at);
      ASSERT_TRUE(test::same_bits(cell, old == world.end() ? grid->schema().background() : old->second))
          << "seed 5, move " << move;
      // The vehicle is within half a cell of the middle.
      ASSERT_LE(std::fabs(centre_of(at).x_m - vehicle.x_m), 3.4);
    }
  }
}

TEST(MovingGrid, RefusesHalfCells) {
  const CellSchema schema(test::paper_types());
  EXPECT_THROW(make_moving_grid(schema, Frame{}, 0.3, 1.0), Error);
  EXPECT_THROW(make_moving_grid(schema, Frame{}, 0, 1.0), Error);
  EXPECT_THROW(make_moving_grid(schema, Frame{}, 0.1, -1.0), Error);
  EXPECT_THROW(make_moving_grid(schema, Frame{}, 0.1, 1e9), Error);
  const auto grid = make_moving_grid(schema, Frame{}, 0.1, 1.0);
  EXPECT_THROW(grid->move_to({NAN, 0}), Error);
  EXPECT_THROW(static_cast<void>(grid->find({0, 1e10})), Error);
}

class NonUniformGrid : public testing::TestWithParam<std::uint64_t> {};

TEST_P(NonUniformGrid, FindsTheCellsOfItsBlocks) {
  Random random(GetParam());
  const Frame frame = test::frame_at(1'234'567, -7'654'321);
  const auto grid = make_nonuniform_grid(CellSchema(test::paper_types()), frame, small_plan());
  for (int move = 0; move < 5; ++move) {
    grid->move_to({30 * random.unit(), 30 * random.unit()});
    std::size_t cells = 0;
    grid->for_each_block([&](const CellBlock& block) {
      EXPECT_EQ((block.x_um - frame.datum_x_um) % block.cell_x_um, 0);
      EXPECT_EQ((block.y_um - frame.datum_y_um) % block.cell_y_um, 0);
      for (int b = 0; b < block.rows; ++b) {
        for (int a = 0; a < block.columns; ++a, ++cells) {
          const Point low{static_cast<double>(block.x_um + a * block.cell_x_um) / 1e6,
                          static_cast<double>(block.y_um + b * block.cell_y_um) / 1e6};
          const Point high{low.x_m + static_cast<double>(block.cell_x_um) / 1e6 - 1e-6,
                           low.y_m + static_cast<double>(block.cell_y_um) / 1e6 - 1e-6};
          const float* cell = block.cells + b * block.row_stride + a * 6;
          ASSERT_EQ(grid->find(low), cell);
          ASSERT_EQ(grid->find(high), cell);
          ASSERT_EQ(grid->insert(low), cell);
        }
      }
    });
    EXPECT_EQ(cells, grid->footprint().cells);
  }
}

TEST_P(NonUniformGrid, MovingKeepsTheSumOfEvidenceThatStaysInside) {
  Random random(GetParam());
  const auto grid = make_nonuniform_grid(CellSchema(test::paper_types()), Frame{}, small_plan());
  // Data in the middle only: it never leaves.
  for (int i = 0; i < 400; ++i) {
    float* cell = grid->insert({2 * random.unit() - 1, 2 * random.unit() - 1});
    cell[0] = static_cast<float>(0.3 * random.unit());
    cell[1] = static_cast<float>(0.1 * random.unit());
  }
  const double before = total_lambda(test::cells_of(*grid));
  for (int move = 0; move < 12; ++move) {
    grid->move_to({12 * random.unit() - 6, 12 * random.unit() - 6});
    const CellMap cells = test::cells_of(*grid);
    ASSERT_NEAR(total_lambda(cells) / before, 1, 1e-5) << "move " << move;
    for (const auto& [at, cell] : cells) ASSERT_LE(cell[0] + cell[1], 1.0f);
  }
}

TEST_P(NonUniformGrid, ThereAndBackKeepsTheBitsOfTheMiddle) {
  Random random(GetParam());
  const auto grid = make_nonuniform_grid(CellSchema(test::paper_types()), Frame{}, small_plan());
  test::scribble(*grid, random);
  const CellMap before = test::cells_of(*grid);
  grid->move_to({0.4, -0.8});
  grid->move_to({0, 0});
  std::size_t kept = 0;
  for (const auto& [at, cell] : test::cells_of(*grid)) {
    const Point p = centre_of(at);
    const bool stays_fine = p.x_m > -1.2 && p.x_m < 1.6 && p.y_m > -1.6 && p.y_m < 0.8;
    if (stays_fine) {
      ASSERT_TRUE(test::same_bits(cell, before.at(at)));
      ++kept;
    }
  }
  EXPECT_EQ(kept, 28u * 24);
}

TEST_P(NonUniformGrid, CellsThatChangeSizeAreResampled) {
  Random random(GetParam());
  const TypeTable types = test::paper_types();
  const auto grid = make_nonuniform_grid(CellSchema(types), Frame{}, small_plan());
  test::scribble(*grid, random);
  const CellMap before = test::cells_of(*grid);
  grid->move_to({0.8, 0});
  // x in [-1.6, -0.8) was fine and is coarse now: each cell is the merge of four.
  int merged = 0;
  for (const auto& [at, cell] : test::cells_of(*grid)) {
    const Point p = centre_of(at);
    if (p.x_m < -1.6 || p.x_m > -0.8 || p.y_m < -1.6 || p.y_m > 1.6) continue;
    for (TypeId t = 0; t < types.size(); ++t) {
      const int first = grid->schema().first(t);
      Layer fine(types[t], 1), coarse;
      for (int i = 0; i < 4; ++i) {
        const auto& part = before.at({at.first + i % 2 * 100'000, at.second + i / 2 * 100'000});
        for (int c = 0; c < fine.channels(); ++c) {
          fine.at(c, {i % 2, i / 2}) = part[static_cast<std::size_t>(first + c)];
        }
      }
      resample(fine, types[t], 0, coarse);
      for (int c = 0; c < fine.channels(); ++c) {
        ASSERT_NEAR(coarse.plane(c)[0], cell[static_cast<std::size_t>(first + c)], 2e-6);
      }
    }
    ++merged;
  }
  EXPECT_EQ(merged, 4 * 16);
}

TEST_P(NonUniformGrid, OnlyTheStepsOfTheCoarsestCellMoveIt) {
  Random random(GetParam());
  const auto grid = make_nonuniform_grid(CellSchema(test::paper_types()), Frame{}, small_plan());
  test::scribble(*grid, random);
  const CellMap before = test::cells_of(*grid);
  for (const double x : {0.19, -0.2, 0.1}) grid->move_to({x, -0.2});
  EXPECT_TRUE(test::cells_of(*grid) == before);
  grid->move_to({0.21, 0});
  EXPECT_EQ(test::cells_of(*grid).begin()->first.first, before.begin()->first.first + 400'000);
}

INSTANTIATE_TEST_SUITE_P(Seeds, NonUniformGrid, testing::Values(1, 2, 3));

TEST(NonUniformGridC, CellsThatAreNotSquareMoveToo) {
  NonUniformPlan plan{"small-c", {}};
  for (const auto& [y0, y1, dy] : {std::tuple(-4.8, -1.6, 0.4), {-1.6, 1.6, 0.1}, {1.6, 4.8, 0.4}}) {
    for (const auto& [x0, x1, dx] : {std::tuple(-4.8, -1.6, 0.4), {-1.6, 1.6, 0.1}, {1.6, 4.8, 0.4}}) {
      plan.rectangles.push_back({x0, x1, y0, y1, dx, dy});
    }
  }
  const auto grid = make_nonuniform_grid(CellSchema(TypeTable({LayerType::occupancy()})), Frame{}, plan);
  // One fine cell: moved into a wide cell it is one of four, its lambda all there.
  grid->insert({-1.55, 0.05})[0] = 0.5f;
  grid->move_to({0.4, 0});
  const float* wide = grid->find({-1.4, 0.05});
  ASSERT_NE(wide, nullptr);
  EXPECT_NEAR(wide[0], 0.5, 1e-6);
  EXPECT_EQ(grid->find({-1.25, 0.05}), wide);
  EXPECT_NE(grid->find({-1.25, 0.15}), wide);
  // Back: a quarter of the lambda in each.
  grid->move_to({0, 0});
  for (const double x : {-1.55, -1.45, -1.35, -1.25}) {
    EXPECT_NEAR(grid->find({x, 0.05})[0], 1 - std::pow(0.5, 0.25), 1e-6) << x;
  }
  // High over wide: of 0.1 x 0.4 m and 0.4 x 0.1 m.
  grid->insert({0.05, 1.7})[0] = 0.9f;
  const double before = total_lambda(test::cells_of(*grid));
  for (const Point p : {Point{2, 2}, Point{-1.2, 3.2}, Point{0, 0}}) {
    grid->move_to(p);
    EXPECT_NEAR(total_lambda(test::cells_of(*grid)), before, 1e-5);
  }
}

}  // namespace
}  // namespace apgm
