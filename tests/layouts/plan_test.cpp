#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "apgm/core/error.hpp"
#include "apgm/layouts/description.hpp"
#include "support.hpp"

namespace apgm {
namespace {

using testing::HasSubstr;

/// The message of the error that `act` throws, and its hint.
template <class Act>
std::string message_of(Act&& act) {
  try {
    act();
  } catch (const Error& error) {
    return error.message() + " | " + error.hint();
  }
  return "no error";
}

std::string message_of(NonUniformPlan plan) {
  return message_of([&] { plan.check(); });
}

std::string message_of_yaml(std::string_view yaml) {
  return message_of([&] { parse_plan(yaml, "plan.yaml"); });
}

NonUniformPlan plan_of(std::vector<LayoutRectangle> rectangles) { return {"test", std::move(rectangles)}; }

class BuerklePreset : public testing::TestWithParam<const char*> {};

TEST_P(BuerklePreset, HoldsTheCellsOfThePaper) {
  const NonUniformPlan plan = buerkle_preset(GetParam());
  EXPECT_NO_THROW(plan.check());
  EXPECT_EQ(plan.cells(), 640'000u);
  const auto grid = make_nonuniform_grid(CellSchema(test::paper_types()), Frame{}, plan);
  const Footprint f = grid->footprint();
  EXPECT_EQ(f.cells, 640'000u);
  EXPECT_EQ(f.values, 640'000u * 6);
  EXPECT_EQ(f.known_cells, 0u);
  EXPECT_EQ(grid->name(), std::string("buerkle-") + GetParam());
}

TEST_P(BuerklePreset, CoversTheSquareOfTheSetting) {
  const auto grid =
      make_nonuniform_grid(CellSchema(test::paper_types()), Frame{}, buerkle_preset(GetParam()));
  for (const double x : {-100.0, -60.1, -20.0, 0.0, 19.99, 59.9, 99.999}) {
    EXPECT_NE(grid->find({x, -x * 0.99}), nullptr) << x;
  }
  for (const double x : {-100.001, 100.0}) {
    EXPECT_EQ(grid->find({x, 0}), nullptr) << x;
    EXPECT_EQ(grid->find({0, x}), nullptr) << x;
    EXPECT_EQ(grid->insert({x, 0}), nullptr) << x;
  }
}

INSTANTIATE_TEST_SUITE_P(All, BuerklePreset, testing::Values("A", "B", "C"));

TEST(BuerklePresets, OnlyCHasCellsThatAreNotSquare) {
  const auto is_square = [](const LayoutRectangle& r) { return r.dx_m == r.dy_m; };
  for (const char* name : {"A", "B"}) {
    for (const LayoutRectangle& r : buerkle_preset(name).rectangles) EXPECT_TRUE(is_square(r)) << name;
  }
  int other = 0;
  for (const LayoutRectangle& r : buerkle_preset("C").rectangles) other += !is_square(r);
  EXPECT_EQ(other, 4);
  EXPECT_THAT(message_of([] { buerkle_preset("D"); }), HasSubstr("'D'"));
}

TEST(NonUniformPlan, NamesWhatIsWrong) {
  EXPECT_THAT(message_of(plan_of({})), HasSubstr("no rectangles"));
  EXPECT_THAT(message_of(plan_of({{0, 4, 0, 4, 1, 1}, {3, 8, 0, 4, 1, 1}})),
              HasSubstr("rectangles 1 and 2 overlap"));
  EXPECT_THAT(message_of(plan_of({{0, 4, 0, 4, 1, 1}, {4, 8, 0, 3, 1, 1}})),
              HasSubstr("gap at x 4 to 8 m, y 3 to 4 m"));
  EXPECT_THAT(message_of(plan_of({{0, 4, 0, 4, 1, 1}, {5, 8, 0, 4, 1, 1}})), HasSubstr("gap at x 4 to 5 m"));
  EXPECT_THAT(message_of(plan_of({{0, 4, 0, 4, 1, 1}, {4, 8, 0, 4, 1, 0.3}})),
              HasSubstr("rectangle 2 does not begin and end at multiples"));
  EXPECT_THAT(message_of(plan_of({{0, 3, 0, 3, 1, 1}, {3, 6, 0, 3, 3, 3}})),
              HasSubstr("rectangle 2 has cells whose side is not the least side times a power of two"));
  EXPECT_THAT(message_of(plan_of({{4, 0, 0, 4, 1, 1}})), HasSubstr("rectangle 1 is empty or inverted"));
  EXPECT_THAT(message_of(plan_of({{0, 4, 0, 4, 1, 0}})), HasSubstr("without area"));
  EXPECT_THAT(message_of(plan_of({{0, 4, 0, 4, -1, 1}})), HasSubstr("without area"));
  EXPECT_THAT(message_of(plan_of({{0, 1, 0, 1, 0.33333333, 1}})), HasSubstr("whole number of micrometres"));
  EXPECT_THAT(message_of(plan_of({{0, NAN, 0, 1, 1, 1}})), HasSubstr("rectangle 1: x1"));
  EXPECT_THAT(message_of(plan_of({{0, 1e9, 0, 1, 1, 1}})), HasSubstr("within 1e6"));
  EXPECT_THAT(message_of(plan_of({{0, 1e6, 0, 1e6, 0.1, 0.1}})), HasSubstr("2^28"));
  EXPECT_THAT(message_of(plan_of({{-1e6, 1e6, -1e6, 1e6, 1e-6, 1e-6}})), HasSubstr("2^28"));
  EXPECT_THAT(message_of(plan_of(std::vector<LayoutRectangle>(257, {0, 1, 0, 1, 1, 1}))), HasSubstr("256"));
}

TEST(ParsePlan, ReadsRectangles) {
  const NonUniformPlan plan = parse_plan(R"(
name: corridor
rectangles:
  - {x_m: [-20, 20], y_m: [-4, 4], cell_m: 0.1}
  - {x_m: [20, 60], y_m: [-4, 4], cell_m: [0.4, 0.1]}
)",
                                         "plan.yaml");
  EXPECT_EQ(plan.name, "corridor");
  ASSERT_EQ(plan.rectangles.size(), 2u);
  EXPECT_EQ(plan.rectangles[1].x1_m, 60);
  EXPECT_EQ(plan.rectangles[1].dx_m, 0.4);
  EXPECT_EQ(plan.rectangles[1].dy_m, 0.1);
  EXPECT_EQ(plan.cells(), 400u * 80 + 100u * 80);
  EXPECT_EQ(parse_plan("rectangles: [{x_m: [0, 1], y_m: [0, 1], cell_m: 1}]", "one.yaml").name, "one.yaml");
}

TEST(ParsePlan, RefusesWhatItDoesNotKnow) {
  EXPECT_THAT(message_of_yaml("rectangle: []"), HasSubstr("did you mean 'rectangles'"));
  EXPECT_THAT(message_of_yaml("name: x"), HasSubstr("rectangles"));
  EXPECT_THAT(message_of_yaml("rectangles: [{x_m: [0, 1], y_m: [0, 1], cell_m: 1, offset: 2}]"),
              HasSubstr("'offset'"));
  EXPECT_THAT(message_of_yaml("rectangles: [{x_m: [0, 1], y_m: [0, 1]}]"), HasSubstr("cell_m"));
  EXPECT_THAT(message_of_yaml("rectangles: [{x_m: [0, 1, 2], y_m: [0, 1], cell_m: 1}]"), HasSubstr("x_m"));
  EXPECT_THAT(message_of_yaml("rectangles: [{x_m: [0, one], y_m: [0, 1], cell_m: 1}]"), HasSubstr("one"));
  EXPECT_THAT(message_of_yaml("rectangles: [{x_m: [0, .inf], y_m: [0, 1], cell_m: 1}]"), HasSubstr("inf"));
  EXPECT_THAT(message_of_yaml("rectangles: []"), HasSubstr("'plan.yaml': the layout has no rectangles"));
  EXPECT_THAT(message_of_yaml("rectangles: [{x_m: [0, 2], y_m: [0, 1], cell_m: 1},\n"
                              "             {x_m: [1, 3], y_m: [0, 1], cell_m: 1}]"),
              HasSubstr("'plan.yaml': rectangles 1 and 2 overlap"));
  EXPECT_THAT(message_of_yaml("rectangles: ["), HasSubstr("not valid YAML"));
}

TEST(MakeNonUniformGrid, RefusesWhatTheMemoryWillNotHold) {
  std::vector<LayerType> many;
  for (int i = 0; i < 16; ++i) {
    many.push_back(LayerType::real("r" + std::to_string(i), {"a", "b", "c", "d", "e", "f", "g", "h"}));
  }
  const NonUniformPlan plan = plan_of({{-819.2, 819.2, -819.2, 819.2, 0.1, 0.1}});
  EXPECT_NO_THROW(plan.check());
  EXPECT_THAT(message_of([&] { make_nonuniform_grid(CellSchema(TypeTable(many)), Frame{}, plan); }),
              HasSubstr("8 GiB"));
  EXPECT_THROW(CellSchema(TypeTable{}), Error);
}

TEST(MakeLayout, RepeatsWhatIsDescribed) {
  const CellSchema schema(test::paper_types());
  const Frame frame = test::frame_at(573'100'000'000, -1);
  std::vector<std::unique_ptr<Layout>> all;
  all.push_back(make_nonuniform_grid(schema, frame, buerkle_preset("C")));
  all.push_back(make_submap_grid(schema, frame, 0.1, SubMapContainer::kQuadtree, 20));
  for (const auto& layout : all) {
    layout->move_to({573'111.2, 5});
    layout->insert({573'111.2, 5})[0] = 0.5f;
    const LayoutDescription d = layout->describe();
    const auto twin = make_layout(schema, d);
    EXPECT_EQ(twin->name(), layout->name());
    twin->insert({573'111.2, 5})[0] = 0.5f;
    EXPECT_TRUE(test::cells_of(*twin) == test::cells_of(*layout));
    EXPECT_EQ(twin->describe().horizon_m, d.horizon_m);
  }
  LayoutDescription off = all[0]->describe();
  off.vehicle_x_um += 100'000;
  EXPECT_THROW(make_layout(schema, off), Error);
}

}  // namespace
}  // namespace apgm
