#include "libapgm/src/ops/region.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

namespace apgm::ops {
namespace {

using Cover = PolygonArea::Cover;

TEST(RegionMask, KeepsExactlyTheCellsThatMeetTheBox) {
  Frame frame;
  frame.edge_um = 12'800'000;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> coordinate(-20, 33);
  std::vector<std::uint8_t> keep;
  std::array<int, 3> covers{};
  for (int round = 0; round < 400; ++round) {
    Box box{{coordinate(random), coordinate(random)}, {coordinate(random), coordinate(random)}};
    if (box.min.x_m > box.max.x_m) std::swap(box.min.x_m, box.max.x_m);
    if (box.min.y_m > box.max.y_m) std::swap(box.min.y_m, box.max.y_m);
    const Region region({box, {}, nullptr}, Snap::kCell, frame);
    const int step = round % 6;
    const Cover cover = region.mask({0, 0}, step, keep);
    const Frame::CellRange in = frame.cells_meeting({0, 0}, step, box);
    const std::int32_t side = 1 << step;
    ASSERT_EQ(keep.size(), static_cast<std::size_t>(side) * side);
    std::int32_t kept = 0;
    for (std::int32_t i = 0; i < side * side; ++i) {
      const std::int32_t a = i % side, b = i / side;
      const bool inside = a >= in.min.a && a <= in.max.a && b >= in.min.b && b <= in.max.b;
      ASSERT_EQ(keep[static_cast<std::size_t>(i)], inside ? 1 : 0) << "round " << round << ", cell " << i;
      kept += inside;
    }
    const Cover expected = kept == 0 ? Cover::kNone : kept == side * side ? Cover::kAll : Cover::kPart;
    EXPECT_EQ(cover, expected) << "round " << round;
    ++covers[static_cast<std::size_t>(cover)];
  }
  for (const int times : covers) EXPECT_GT(times, 10);
}

TEST(RegionMask, CutsABoxOutOfAPolygon) {
  Frame frame;
  frame.edge_um = 8'000'000;
  const Polygon square{{{{0, 0}, {8, 0}, {8, 8}, {0, 8}}}};
  const Region region({Box{{2, 3}, {5, 8}}, square, nullptr}, Snap::kCell, frame);
  std::vector<std::uint8_t> keep;
  EXPECT_EQ(region.mask({0, 0}, 3, keep), Cover::kPart);
  EXPECT_EQ(std::ranges::count(keep, 1), 3 * 5);
  EXPECT_EQ(keep[3 * 8 + 2], 1);
  EXPECT_EQ(keep[2 * 8 + 2], 0);
}

}  // namespace
}  // namespace apgm::ops
