#include "tools/common/diff_picture.hpp"

#include <gtest/gtest.h>

#include <set>
#include <tuple>

namespace apgm::tools {
namespace {

constexpr std::uint8_t kOccupied = CellDiff::kFirst, kFree = CellDiff::kFirst + 1;

Colour colour(const Rendering& r, const std::string& label) {
  for (const LegendEntry& entry : r.legend.entries) {
    if (entry.label == label) return entry.colour;
  }
  ADD_FAILURE() << "no entry '" << label << "'";
  return {};
}

TEST(DiffPictureTest, EveryKindHasItsColour) {
  DiffPicture picture(LayerType::occupancy());
  const std::vector<CellDiff> cells{{kFree, kOccupied, true, 0.5f},
                                    {kOccupied, kFree, true, 0.5f},
                                    {CellDiff::kUnknown, kFree, true, 0},
                                    {kOccupied, CellDiff::kUnknown, true, 0},
                                    {kFree, kFree, true, 0.3f},
                                    {kFree, kFree, true, 0.1f},
                                    {kOccupied, kOccupied, false, 0},
                                    {kFree, kOccupied, false, 0.9f},
                                    {},
                                    {},
                                    {},
                                    {},
                                    {},
                                    {},
                                    {},
                                    {}};
  picture.put({0, 0}, 2, cells);
  const Rendering r = picture.rendering({});
  ASSERT_EQ(r.raster.width, 512);  // small maps are drawn larger
  EXPECT_EQ(r.patch_px, 512);
  const auto cell = [&](int i) { return r.raster.at((i % 4) * 128 + 5, 511 - (i / 4) * 128 - 5); };
  EXPECT_EQ(cell(0), colour(r, "free -> occupied"));
  EXPECT_EQ(cell(1), colour(r, "occupied -> free"));
  EXPECT_EQ(cell(2), colour(r, "learned free"));
  EXPECT_EQ(cell(3), colour(r, "forgotten occupied"));
  EXPECT_EQ(cell(4), colour(r, "conflict K >= 0.25"));
  EXPECT_EQ(cell(5), colour(r, "free in both"));
  EXPECT_EQ(cell(6), colour(r, "occupied in both"));
  EXPECT_EQ(cell(7), colour(r, "occupied in both"));  // within the tolerance: as it is now
  EXPECT_EQ(cell(8), colour(r, "unknown in both"));
  std::set<std::tuple<int, int, int>> colours;
  for (const LegendEntry& e : r.legend.entries) colours.insert({e.colour.red, e.colour.green, e.colour.blue});
  EXPECT_EQ(colours.size(), r.legend.entries.size());
}

TEST(DiffPictureTest, OtherTypesHaveTheirOwnLegend) {
  const Rendering semantic = DiffPicture(LayerType::semantic("s", {"a", "b"})).rendering({});
  const Rendering real = DiffPicture(LayerType::real("z", {"z"})).rendering({});
  EXPECT_TRUE(semantic.raster.empty());
  (void)colour(semantic, "class changed");
  (void)colour(real, "changed");
}

}  // namespace
}  // namespace apgm::tools
