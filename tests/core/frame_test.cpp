#include "apgm/core/frame.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "apgm/core/error.hpp"

namespace apgm {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

Frame utm() {
  Frame frame;
  frame.datum_x_um = 570'000'000'000;
  frame.datum_y_um = 5'360'000'000'000;
  frame.epsg = 32632;
  return frame;
}

TEST(FloorDivTest, RoundsTowardsMinusInfinity) {
  EXPECT_EQ(floor_div(7, 3), 2);
  EXPECT_EQ(floor_div(-7, 3), -3);
  EXPECT_EQ(floor_div(-6, 3), -2);
  EXPECT_EQ(floor_div(std::numeric_limits<std::int64_t>::min(), 3), -3074457345618258603);
}

TEST(FrameTest, DecimalCornersLieInTheCellTheyBegin) {
  // 0.3 is below 3 * 0.1 as a double: a division of doubles would say cell 2.
  Frame frame;
  for (int i = -300; i < 300; ++i) {
    const auto cell = frame.cell_at({i * 0.1, 0}, 7);
    EXPECT_EQ(cell.patch.x * 128 + cell.cell.a, i) << i;
  }
}

TEST(FrameTest, CellsAreHalfOpenAtNegativeAndUtmCoordinates) {
  const Frame frame = utm();
  const auto at = frame.cell_at({570'000.0, 5'360'000.0}, 7);
  EXPECT_EQ(at.patch, (PatchIndex{0, 0}));
  EXPECT_EQ(at.cell, (CellIndex{0, 0}));
  const auto below = frame.cell_at({570'000.0 - 1e-6, 5'360'000.0 - 12.8}, 7);
  EXPECT_EQ(below.patch, (PatchIndex{-1, -1}));
  EXPECT_EQ(below.cell, (CellIndex{127, 0}));
}

TEST(FrameTest, EveryPointLiesInTheCellItIsPutIn) {
  std::mt19937_64 rng(11);
  for (int i = 0; i < 20'000; ++i) {
    Frame frame;
    frame.edge_um = static_cast<std::int64_t>(1'000 + rng() % 100'000'000);
    frame.datum_x_um = static_cast<std::int64_t>(rng() % 1'000'000'000'000) - 500'000'000'000;
    const int step = static_cast<int>(rng() % (kMaxStep + 1));
    const double x =
        static_cast<double>(static_cast<std::int64_t>(rng() % 2'000'000'000'000) - 1'000'000'000'000) * 1e-6;
    Frame::Cell cell;
    try {
      cell = frame.cell_at({x, 0}, step);
    } catch (const Error& e) {
      ASSERT_EQ(e.code(), ErrorCode::kLimit);
      continue;
    }
    // In units of edge / 2^step nanometres, exactly.
    const __int128 offset =
        (static_cast<__int128>(std::llrint(x * 1e9)) - static_cast<__int128>(frame.datum_x_um) * 1000);
    const __int128 edge = static_cast<__int128>(frame.edge_um) * 1000;
    const __int128 index = (static_cast<__int128>(cell.patch.x) << step) + cell.cell.a;
    ASSERT_LE(index * edge, offset << step);
    ASSERT_GT((index + 1) * edge, offset << step);
  }
}

TEST(FrameTest, RefusesPointsThatAreNotNumbersOrTooFar) {
  const Frame frame;
  for (const double bad : {kNan, kInf, -kInf, 5e9}) EXPECT_THROW(frame.patch_at({bad, 0}), Error) << bad;
  Frame fine;
  fine.edge_um = 1'000;
  EXPECT_THROW(fine.patch_at({3e9, 0}), Error);
}

TEST(FrameTest, PatchesMeetingABoxAreHalfOpen) {
  const Frame frame;
  EXPECT_EQ(frame.patches_meeting({{0, 0}, {12.8, 12.8}}), (PatchRange{{0, 0}, {0, 0}}));
  EXPECT_EQ(frame.patches_meeting({{0, 0}, {12.800001, 12.8}}), (PatchRange{{0, 0}, {1, 0}}));
  EXPECT_EQ(frame.patches_meeting({{-0.1, -12.8}, {0, 0}}), (PatchRange{{-1, -1}, {-1, -1}}));
  EXPECT_EQ(frame.patches_meeting({{-4e9, -4e9}, {4e9, 4e9}}).contains({1000, -1000}), true);
}

TEST(FrameTest, RefusesBoxesThatAreInvertedEmptyOrNotNumbers) {
  const Frame frame;
  for (const Box& bad :
       {Box{{1, 0}, {0, 1}}, Box{{0, 0}, {0, 1}}, Box{{0, kNan}, {1, 1}}, Box{{0, 0}, {kInf, 1}}}) {
    EXPECT_THROW(frame.patches_meeting(bad), Error);
  }
}

TEST(FrameTest, CellsMeetingABox) {
  const Frame frame;
  const auto cells = frame.cells_meeting({0, 0}, 7, {{0.1, 0.25}, {0.3, 0.31}});
  EXPECT_EQ(cells.min, (CellIndex{1, 2}));
  EXPECT_EQ(cells.max, (CellIndex{2, 3}));
  EXPECT_TRUE(frame.cells_meeting({0, 0}, 7, {{-5, -5}, {100, 100}}).all(7));
  EXPECT_TRUE(frame.cells_meeting({3, 0}, 7, {{0, 0}, {12.8, 12.8}}).empty());
}

TEST(FrameTest, CellsMeetingAgreesWithCellAt) {
  std::mt19937_64 rng(5);
  const Frame frame = utm();
  for (int i = 0; i < 5'000; ++i) {
    const int step = static_cast<int>(rng() % 8);
    const double x = 570'000 + static_cast<double>(rng() % 100'000) * 0.001, y = 5'360'000;
    const Box box{{x, y}, {x + 0.001, y + 12.8}};  // one millimetre wide: the cell that holds x
    const auto cell = frame.cell_at({x, y}, step);
    const auto cells = frame.cells_meeting(cell.patch, step, box);
    ASSERT_EQ(cells.min.a, cell.cell.a);
    ASSERT_LE(cells.max.a - cells.min.a, 1);
  }
}

TEST(FrameTest, StepForIsTheCoarsestThatSatisfies) {
  const Frame frame;
  EXPECT_EQ(frame.step_for(0.1), 7);
  EXPECT_EQ(frame.step_for(0.2), 6);
  EXPECT_EQ(frame.step_for(0.4), 5);
  EXPECT_EQ(frame.step_for(0.15), 7);
  EXPECT_EQ(frame.step_for(12.8), 0);
  EXPECT_EQ(frame.step_for(100), 0);
  for (const double bad : {0.0, -1.0, kNan, kInf, 0.001}) EXPECT_THROW(frame.step_for(bad), Error) << bad;
}

TEST(FrameTest, CheckRefusesWhatAFileCannotHold) {
  const auto refuses = [](auto change) {
    Frame frame;
    change(frame);
    EXPECT_THROW(frame.check(), Error);
  };
  EXPECT_NO_THROW(utm().check());
  refuses([](Frame& f) { f.edge_um = 999; });
  refuses([](Frame& f) { f.edge_um = 10'000'000'001; });
  refuses([](Frame& f) { f.datum_x_um = 1'000'000'000'000'001; });
  refuses([](Frame& f) { f.datum_y_um = std::numeric_limits<std::int64_t>::min(); });
  refuses([](Frame& f) { f.epsg = 0; });
  refuses([](Frame& f) { f.frame_id = "\xff"; });
  refuses([](Frame& f) { f.frame_id.clear(); });
  refuses([](Frame& f) { f.frame_id = "a\nb"; });
}

TEST(FrameTest, DifferenceNamesWhatDiffersWithBothValues) {
  Frame a, b;
  EXPECT_EQ(difference(a, b), "");
  b.frame_id = "odom";
  EXPECT_EQ(difference(a, b), "frame ids differ ('map' and 'odom')");
  b.epsg = 25832;
  b.edge_um = 25'600'001;
  b.datum_x_um = -1;
  b.datum_y_um = -12'500'000;
  EXPECT_EQ(difference(a, b),
            "frame ids differ ('map' and 'odom'); EPSG codes differ (none and 25832); "
            "patch edges differ (12.8 m and 25.600001 m); datums differ (0,0 m and -0.000001,-12.5 m)");
}

TEST(PatchRangeTest, GrowsFromEmpty) {
  PatchRange range;
  EXPECT_TRUE(range.empty());
  range.add(PatchIndex{3, -2});
  range.add(PatchIndex{-1, 5});
  EXPECT_EQ(range, (PatchRange{{-1, -2}, {3, 5}}));
  EXPECT_FALSE(range.meets(PatchRange{}));
  EXPECT_TRUE(range.meets(PatchRange{{3, 5}, {9, 9}}));
}

TEST(CurveKeyTest, WalksNeighbourToNeighbour) {
  for (const std::int32_t corner : {-32, 0, 1 << 20}) {
    std::vector<std::pair<std::uint64_t, PatchIndex>> cells;
    for (std::int32_t x = 0; x < 32; ++x) {
      for (std::int32_t y = 0; y < 32; ++y)
        cells.emplace_back(curve_key({x + corner, y + corner}), PatchIndex{x + corner, y + corner});
    }
    std::sort(cells.begin(), cells.end());
    for (std::size_t i = 1; i < cells.size(); ++i) {
      ASSERT_EQ(cells[i].first, cells[i - 1].first + 1);
      ASSERT_EQ(std::abs(cells[i].second.x - cells[i - 1].second.x) +
                    std::abs(cells[i].second.y - cells[i - 1].second.y),
                1);
    }
  }
}

TEST(CurveKeyTest, IsFrozen) {
  // Part of the file format: docs/format.md lists the same values.
  const auto lowest = std::numeric_limits<std::int32_t>::min(),
             highest = std::numeric_limits<std::int32_t>::max();
  EXPECT_EQ(curve_key({lowest, lowest}), 0u);
  EXPECT_EQ(curve_key({highest, lowest}), 0xffffffffffffffffu);
  EXPECT_EQ(curve_key({0, 0}), 0x8000000000000000u);
  EXPECT_EQ(curve_key({-1, -1}), 0x2aaaaaaaaaaaaaaau);
  EXPECT_EQ(curve_key({0, 1}), curve_key({0, 0}) + 1);
  EXPECT_EQ(curve_key({1, 1}), curve_key({0, 0}) + 2);
  EXPECT_EQ(curve_key({1, 0}), curve_key({0, 0}) + 3);
}

TEST(CurveKeyTest, ABoxTouchesFewRuns) {
  std::mt19937_64 rng(3);
  double runs = 0;
  constexpr int kBoxes = 50, kSide = 24;
  for (int i = 0; i < kBoxes; ++i) {
    const auto x0 = static_cast<std::int32_t>(rng() % 4096), y0 = static_cast<std::int32_t>(rng() % 4096);
    std::vector<std::uint64_t> keys;
    for (std::int32_t x = 0; x < kSide; ++x) {
      for (std::int32_t y = 0; y < kSide; ++y) keys.push_back(curve_key({x0 + x, y0 + y}));
    }
    std::sort(keys.begin(), keys.end());
    for (std::size_t k = 0; k < keys.size(); ++k) runs += k == 0 || keys[k] != keys[k - 1] + 1;
  }
  EXPECT_LT(runs / kBoxes, 1.3 * kSide);
}

}  // namespace
}  // namespace apgm
