#include "apgm/layouts/cost.hpp"

#include <gtest/gtest.h>

#include "apgm/core/error.hpp"
#include "apgm/layouts/moving_grid.hpp"
#include "apgm/layouts/submap_grid.hpp"
#include "support.hpp"

namespace apgm {
namespace {

CostOptions few() {
  CostOptions options;
  options.accesses = 50;
  options.shifts = 2;
  options.growths = 3;
  // Every reading is a millisecond later than the one before.
  options.now_ns = [now = std::int64_t{0}]() mutable { return now += 1'000'000; };
  return options;
}

TEST(MeasureCost, DividesByWhatWasDone) {
  const auto grid = make_moving_grid(CellSchema(test::paper_types()), Frame{}, 0.2, 3.2);
  const LayoutCost cost = measure_cost(*grid, {0, 0}, 7, few());
  EXPECT_EQ(cost.find_ns, 1e6 / 50);
  EXPECT_EQ(cost.insert_ns, 1e6 / 50);
  EXPECT_EQ(cost.grow_ns, 0);
  EXPECT_EQ(cost.shift_ns, 1e6 / 2);
  EXPECT_EQ(cost.iterate_ns, 1e6 / 1024);
  EXPECT_EQ(cost.snapshot_ns, 1e6);
}

TEST(MeasureCost, LeavesTheLayoutAlone) {
  for (const SubMapContainer container : kSubMapContainers) {
    const auto grid = make_submap_grid(CellSchema(test::paper_types()), Frame{}, 0.8, container, 30);
    grid->reserve({0, 0, 30'000'000, 14'000'000});
    test::Random random(1);
    test::scribble(*grid, random);
    const auto before = test::cells_of(*grid);
    const LayoutCost cost = measure_cost(*grid, {5, 5}, 7, few());
    EXPECT_EQ(test::cells_of(*grid), before) << grid->name();
    EXPECT_EQ(cost.grow_ns, 1e6);
    CostOptions real = few();
    real.now_ns = nullptr;
    EXPECT_GT(measure_cost(*grid, {5, 5}, 7, real).find_ns, 0);
  }
}

TEST(MeasureCost, NeedsCells) {
  const auto grid =
      make_submap_grid(CellSchema(test::paper_types()), Frame{}, 0.8, SubMapContainer::kHashMap);
  EXPECT_THROW(measure_cost(*grid, {0, 0}, 1), Error);
  grid->insert({0, 0});
  CostOptions none;
  none.accesses = 0;
  EXPECT_THROW(measure_cost(*grid, {0, 0}, 1, none), Error);
}

}  // namespace
}  // namespace apgm
