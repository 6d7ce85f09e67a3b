#include "apgm/core/polygon.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "apgm/core/error.hpp"
#include "random_map.hpp"

namespace apgm {
namespace {

using Cover = PolygonArea::Cover;

Frame unit_frame() {
  Frame frame;
  frame.edge_um = 1'000'000;
  return frame;
}

/// Even-odd test of one point, in long double: right wherever the point is not within rounding of an edge.
bool inside(const Polygon& polygon, Point p) {
  bool in = false;
  for (const auto& ring : polygon.rings) {
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const Point &a = ring[i], &b = ring[(i + 1) % ring.size()];
      if ((a.y_m <= p.y_m) == (b.y_m <= p.y_m)) continue;
      const auto t = (static_cast<long double>(p.y_m) - a.y_m) / (static_cast<long double>(b.y_m) - a.y_m);
      in ^= a.x_m + t * (static_cast<long double>(b.x_m) - a.x_m) <= p.x_m;
    }
  }
  return in;
}

TEST(PolygonArea, KeepsCellsWhoseCentresLieInsideAndOutsideHoles) {
  const Polygon polygon{
      {{{0, 0}, {1, 0}, {1, 1}, {0, 1}}, {{0.25, 0.25}, {0.75, 0.25}, {0.75, 0.75}, {0.25, 0.75}}}};
  const PolygonArea area(polygon, unit_frame());
  std::vector<std::uint8_t> keep;
  area.keep_centres({0, 0}, 2, keep);
  const std::vector<std::uint8_t> expected{1, 1, 1, 1, 1, 0, 0, 1, 1, 0, 0, 1, 1, 1, 1, 1};
  EXPECT_EQ(keep, expected);
}

TEST(PolygonArea, GivesACentreOnAnEdgeToTheUpperRight) {
  // The shared edges x = 0.5 and y = 0.5 run through the centre of the one cell.
  const auto keeps = [](double x0, double y0) {
    const Polygon square{{{{x0, y0}, {x0 + 0.5, y0}, {x0 + 0.5, y0 + 0.5}, {x0, y0 + 0.5}}}};
    std::vector<std::uint8_t> keep;
    PolygonArea(square, unit_frame()).keep_centres({0, 0}, 0, keep);
    return keep[0] != 0;
  };
  EXPECT_TRUE(keeps(0.5, 0.5));
  EXPECT_FALSE(keeps(0.0, 0.5));
  EXPECT_FALSE(keeps(0.5, 0.0));
  EXPECT_FALSE(keeps(0.0, 0.0));
}

TEST(PolygonArea, CoversPatchesExactlyUpToSharedEdges) {
  const Polygon square{{{{0, 0}, {3, 0}, {3, 3}, {0, 3}}}};
  const PolygonArea area(square, unit_frame());
  EXPECT_EQ(area.cover({0, 0}), Cover::kAll);
  EXPECT_EQ(area.cover({2, 2}), Cover::kAll);
  EXPECT_EQ(area.cover({3, 0}), Cover::kNone);
  EXPECT_EQ(area.cover({-1, 1}), Cover::kNone);
  const PolygonArea shifted(Polygon{{{{0, 0}, {2.999999, 0}, {3, 3}, {0, 3}}}}, unit_frame());
  EXPECT_EQ(shifted.cover({2, 1}), Cover::kPart);
  EXPECT_EQ(shifted.cover({1, 1}), Cover::kAll);
}

TEST(PolygonArea, AgreesWithAPointTestOnRandomPolygons) {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    SCOPED_TRACE(seed);
    test::Random random(seed);
    Frame frame = unit_frame();
    frame.datum_x_um = random.in(-5'000'000, 5'000'000);
    frame.datum_y_um = random.in(-5'000'000, 5'000'000);
    Polygon polygon;
    for (int rings = random.in(1, 3); rings > 0; --rings) {
      auto& ring = polygon.rings.emplace_back();
      for (int i = random.in(3, 9); i > 0; --i) {
        ring.push_back({random.in(-4000, 4000) * 1e-3, random.in(-4000, 4000) * 1e-3});
      }
    }
    const PolygonArea area(polygon, frame);
    const int step = random.in(0, 4);
    std::vector<std::uint8_t> keep;
    for (int y = area.range().min.y - 1; y <= area.range().max.y + 1; ++y) {
      for (int x = area.range().min.x - 1; x <= area.range().max.x + 1; ++x) {
        area.keep_centres({x, y}, step, keep);
        const Cover cover = area.cover({x, y});
        const Point origin = frame.origin_m({x, y});
        for (std::size_t i = 0; i < keep.size(); ++i) {
          const int side = 1 << step, a = static_cast<int>(i) % side, b = static_cast<int>(i) / side;
          // Half a nanometre up and right, where points on edges belong.
          const Point centre{origin.x_m + (a + 0.5) / side + 5e-10, origin.y_m + (b + 0.5) / side + 5e-10};
          ASSERT_EQ(keep[i] != 0, inside(polygon, centre)) << x << ' ' << y << ' ' << a << ' ' << b;
          ASSERT_TRUE(cover == Cover::kPart || (keep[i] != 0) == (cover == Cover::kAll));
        }
      }
    }
  }
}

TEST(PolygonArea, StandsTheFarthestCoordinates) {
  Frame frame;
  frame.datum_x_um = -1'000'000'000'000'000;
  frame.edge_um = 10'000'000'000;
  const Polygon polygon{{{{-1e9, -1e9}, {1e9, -1e9}, {1e9, 1e9}, {-1e9, 1e9}}}};
  const PolygonArea area(polygon, frame);
  EXPECT_EQ(area.cover({0, -100'000}), Cover::kAll);
  EXPECT_EQ(area.cover({199'999, 99'999}), Cover::kAll);
  EXPECT_EQ(area.cover({200'000, 0}), Cover::kNone);
  std::vector<std::uint8_t> keep;
  area.keep_centres({199'999, 99'999}, 3, keep);
  EXPECT_EQ(std::ranges::count(keep, 1), 64);
}

TEST(PolygonArea, RefusesWhatIsNoPolygon) {
  EXPECT_THROW(PolygonArea(Polygon{{{{0, 0}, {1, 1}}}}, unit_frame()), Error);
  EXPECT_THROW(PolygonArea(Polygon{{{{0, 0}, {1, 1}, {NAN, 0}}}}, unit_frame()), Error);
  EXPECT_THROW(PolygonArea(Polygon{{{{0, 0}, {1, 1}, {1e10, 0}}}}, unit_frame()), Error);
}

}  // namespace
}  // namespace apgm
