#include "scene/scene.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <random>
#include <utility>
#include <vector>

#include "scene/grid.hpp"
#include "scene/random.hpp"
#include "scene/sensors.hpp"

namespace apgm::samples {
namespace {

bool same_cars(const Scene& a, const Scene& b) {
  if (a.cars().size() != b.cars().size()) return false;
  for (std::size_t i = 0; i < a.cars().size(); ++i) {
    const Rect& p = a.cars()[i];
    const Rect& q = b.cars()[i];
    if (!(p.centre == q.centre && p.half == q.half && p.axis == q.axis)) return false;
  }
  return true;
}

TEST(SceneTest, SeedDecidesTheCars) {
  EXPECT_TRUE(same_cars(Scene(7), Scene(7)));
  EXPECT_FALSE(same_cars(Scene(7), Scene(8)));
  EXPECT_GT(Scene(7).cars().size(), 50u);
}

TEST(SceneTest, RaysEndWhereTheFirstObstacleBegins) {
  const Scene scene;
  Random random(11);
  int hits = 0;
  for (int n = 0; n < 400; ++n) {
    const Point origin{120 * random.uniform(), 80 * random.uniform()};
    if (scene.occupied(origin)) continue;
    const Point along = unit({random.uniform() - 0.5, random.uniform() - 0.5});
    const auto hit = scene.cast(origin, along, 60);
    for (double t = 0; t < hit.range_m - 1e-6; t += 0.05) {
      ASSERT_FALSE(scene.occupied(origin + t * along)) << "ray " << n << " at " << t;
    }
    if (!hit.obstacle) continue;
    ++hits;
    EXPECT_TRUE(scene.occupied(origin + (hit.range_m + 1e-6) * along)) << "ray " << n;
  }
  EXPECT_GT(hits, 200);
}

TEST(SceneTest, RaysEndAtTheBorderAndAtTheirRange) {
  const Scene scene;
  const auto west = scene.cast({2, 12}, {-1, 0}, 60);
  EXPECT_FALSE(west.obstacle);
  EXPECT_DOUBLE_EQ(west.range_m, 2);
  const auto east = scene.cast({2, 12}, {1, 0}, 60);
  EXPECT_FALSE(east.obstacle);
  EXPECT_DOUBLE_EQ(east.range_m, 60);
}

TEST(SceneTest, TellsGroundApart) {
  const Scene scene;
  EXPECT_EQ(scene.ground({30, 10}), Ground::kRoad);
  EXPECT_EQ(scene.ground({30, 8.5}), Ground::kMarking);
  EXPECT_EQ(scene.ground({80, 9}), Ground::kMarking);  // the crossing
  EXPECT_EQ(scene.ground({30, 17}), Ground::kBlocked);
  EXPECT_EQ(scene.ground(scene.cars()[0].centre), Ground::kBlocked);
  EXPECT_TRUE(scene.hidden({60, 70}));
  EXPECT_FALSE(scene.hidden({60, 59}));
}

TEST(DriveTest, VehiclesKeepClearOfObstacles) {
  const Scene scene;
  for (const Drive& drive : {drive_a(), drive_b()}) {
    EXPECT_GT(drive.poses.size(), 30u);
    for (const Pose& pose : drive.poses) {
      for (const Point corner : {Point{2.2, 0.9}, Point{2.2, -0.9}, Point{-2.2, 0.9}, Point{-2.2, -0.9}}) {
        const Point p = pose.position + turned(corner, pose.heading);
        EXPECT_FALSE(scene.occupied(p)) << p.x_m << ", " << p.y_m;
      }
      EXPECT_NEAR(length(pose.heading), 1, 1e-12);
    }
  }
}

TEST(RandomTest, IsTheEngineOfTheStandard) {
  std::mt19937_64 engine;
  engine.discard(9999);
  EXPECT_EQ(engine(), 9981545732273789042u);  // [rand.predef]
}

TEST(RandomTest, BellHasUnitDeviation) {
  Random random(5);
  double sum = 0;
  double squares = 0;
  constexpr int kDraws = 20000;
  for (int i = 0; i < kDraws; ++i) {
    const double v = random.bell();
    ASSERT_LT(std::abs(v), 3.47);
    sum += v;
    squares += v * v;
  }
  EXPECT_NEAR(sum / kDraws, 0, 0.03);
  EXPECT_NEAR(squares / kDraws, 1, 0.03);
}

TEST(TraverseTest, WalksFromCellToNeighbour) {
  Random random(3);
  for (int n = 0; n < 500; ++n) {
    SCOPED_TRACE(n);
    Point from{40 * random.uniform() - 20, 40 * random.uniform() - 20};
    Point to{40 * random.uniform() - 20, 40 * random.uniform() - 20};
    if (n % 5 == 0) to.x_m = from.x_m;
    if (n % 7 == 0) to.y_m = from.y_m;
    if (n % 11 == 0) from = {std::floor(from.x_m), std::floor(from.y_m)};
    std::vector<std::pair<std::int64_t, std::int64_t>> cells;
    int lasts = 0;
    traverse(from, to, [&](std::int64_t i, std::int64_t j, bool last) {
      cells.emplace_back(i, j);
      lasts += last;
      // The segment touches the cell: its distance from the cell's centre is at most half a diagonal.
      const Point centre{static_cast<double>(i) + 0.5, static_cast<double>(j) + 0.5};
      const double reach = length(to - from);
      if (reach == 0) return;
      const Point along = (1 / reach) * (to - from);
      const double t = std::min(reach, std::max(0.0, dot(centre - from, along)));
      EXPECT_LE(length(centre - (from + t * along)), std::sqrt(0.5) + 1e-9);
    });
    EXPECT_EQ(lasts, 1);
    EXPECT_EQ(cells.front().first, static_cast<std::int64_t>(std::floor(from.x_m)));
    EXPECT_EQ(cells.front().second, static_cast<std::int64_t>(std::floor(from.y_m)));
    EXPECT_EQ(cells.back().first, static_cast<std::int64_t>(std::floor(to.x_m)));
    EXPECT_EQ(cells.back().second, static_cast<std::int64_t>(std::floor(to.y_m)));
    for (std::size_t i = 1; i < cells.size(); ++i) {
      EXPECT_EQ(
          std::abs(cells[i].first - cells[i - 1].first) + std::abs(cells[i].second - cells[i - 1].second), 1);
    }
  }
}

}  // namespace
}  // namespace apgm::samples
