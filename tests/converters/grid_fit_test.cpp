#include "converters/common/grid_fit.hpp"

#include "tests/converters/support.hpp"

namespace apgm::converters {
namespace {

GridFit fit(double cell_m, Point origin = {}, const Settings& settings = {}, double yaw = 0,
            testing::Collected* findings = nullptr) {
  const SettingsReader reader(*all().front(), settings, SettingsReader::Use::kReading);
  return fit_grid({cell_m, origin, yaw}, reader, findings != nullptr ? findings->sink() : Findings());
}

TEST(FitGrid, TakesTheEdgeNearestToThePapers) {
  const struct {
    double cell_m;
    int step;
    std::int64_t edge_um;
  } cases[] = {{0.05, 8, 12'800'000}, {0.08, 7, 10'240'000},  {0.03, 9, 15'360'000}, {0.1, 7, 12'800'000},
               {0.2, 6, 12'800'000},  {0.01, 10, 10'240'000}, {20, 0, 20'000'000},   {0.001, 11, 2'048'000}};
  for (const auto& c : cases) {
    const GridFit result = fit(c.cell_m);
    EXPECT_EQ(result.step, c.step) << c.cell_m;
    EXPECT_EQ(result.native.edge_um, c.edge_um) << c.cell_m;
    EXPECT_FALSE(result.target);
  }
}

TEST(FitGrid, DatumIsTheOriginUnlessSet) {
  const GridFit plain = fit(0.05, {-11.606540, -26.520793});
  EXPECT_EQ(plain.native.datum_x_um, -11'606'540);
  EXPECT_EQ(plain.native.datum_y_um, -26'520'793);
  EXPECT_EQ(plain.offset_x, 0);
}

TEST(FitGrid, ADatumWholeCellsAwayKeepsTheCells) {
  const GridFit moved = fit(0.05, {1.0, 2.0}, {{"datum", "0,3.05"}});
  EXPECT_FALSE(moved.target);
  EXPECT_EQ(moved.native.datum_y_um, 3'050'000);
  EXPECT_EQ(moved.offset_x, 20);
  EXPECT_EQ(moved.offset_y, -21);
  EXPECT_EQ(moved.cell_at(0, 0).patch, (PatchIndex{0, -1}));
  EXPECT_EQ(moved.cell_at(0, 0).cell, (CellIndex{20, 235}));
}

TEST(FitGrid, AnythingElseIsRegridded) {
  EXPECT_TRUE(fit(0.05, {}, {{"datum", "0.01,0"}}).target);
  EXPECT_TRUE(fit(0.03, {}, {{"edge_m", "12.8"}}).target);
  EXPECT_TRUE(fit(0.05, {}, {}, 0.1).target);
  EXPECT_EQ(fit(0.03, {}, {{"edge_m", "12.8"}}).target->edge_um, 12'800'000);
}

TEST(FitGrid, AnotherFittingEdgeKeepsTheCells) {
  const GridFit result = fit(0.05, {}, {{"edge_m", "25.6"}});
  EXPECT_FALSE(result.target);
  EXPECT_EQ(result.step, 9);
}

TEST(FitGrid, TakesNames) {
  const GridFit result = fit(0.05, {}, {{"frame_id", "odom"}, {"epsg", "25832"}});
  EXPECT_EQ(result.native.frame_id, "odom");
  EXPECT_EQ(result.native.epsg, 25832);
  EXPECT_EQ(testing::error_of([] { fit(0.05, {}, {{"epsg", "1.5"}}); }).code(), ErrorCode::kInvalidArgument);
}

TEST(FitGrid, SaysWhenSizesAreRounded) {
  testing::Collected findings;
  fit(1.0 / 3, {}, {}, 0, &findings);
  EXPECT_EQ(findings.of(Finding::Kind::kNote).size(), 1u);
  testing::Collected none;
  fit(0.05, {-11.606540, -26.520793}, {}, 0, &none);
  EXPECT_TRUE(none.list.empty());
}

TEST(FitGrid, RefusesWhatPatchesCannotHold) {
  EXPECT_EQ(testing::error_of([] { fit(1e5); }).code(), ErrorCode::kLimit);
  EXPECT_EQ(testing::error_of([] { fit(0.05, {2e9, 0}); }).code(), ErrorCode::kLimit);
  EXPECT_EQ(testing::error_of([] { fit(0.05, {}, {{"edge_m", "0"}}); }).code(), ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace apgm::converters
