#include "scene/scene.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "scene/lot.hpp"
#include "scene/random.hpp"
#include "scene/town.hpp"

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
  for (Scene (*const make)(std::uint64_t) : {lot_scene, town_scene}) {
    EXPECT_TRUE(same_cars(make(7), make(7)));
    EXPECT_FALSE(same_cars(make(7), make(8)));
    EXPECT_GT(make(7).cars().size(), 50u);
  }
}

/// Casts rays from `places` and walks along them.
void expect_rays_end_at_obstacles(const Scene& scene, const std::vector<Point>& places) {
  Random random(11);
  int hits = 0;
  for (std::size_t n = 0; n < places.size(); ++n) {
    const Point origin = places[n];
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

TEST(SceneTest, RaysEndWhereTheFirstObstacleBegins) {
  Random random(12);
  std::vector<Point> places;
  for (int n = 0; n < 400; ++n) places.push_back({120 * random.uniform(), 80 * random.uniform()});
  expect_rays_end_at_obstacles(lot_scene(), places);
  places.clear();
  const Drive drive = town_drive();
  for (std::size_t k = 0; k < drive.poses.size(); k += 8) places.push_back(drive.poses[k].position);
  expect_rays_end_at_obstacles(town_scene(), places);
}

TEST(SceneTest, RaysAlongTheGridOfShapesFindThem) {
  Scene scene({{-20, -10}, {40, 50}}, {});
  scene.add_wall(rect_of({{9, 1}, {11, 3}}));
  scene.add_post({{0, 12}, 0.5});
  EXPECT_DOUBLE_EQ(scene.cast({0, 2}, {1, 0}, 60).range_m, 9);
  EXPECT_DOUBLE_EQ(scene.cast({20, 2}, {-1, 0}, 60).range_m, 9);
  EXPECT_DOUBLE_EQ(scene.cast({0, 0}, {0, 1}, 60).range_m, 11.5);  // along an edge of the grid
  EXPECT_DOUBLE_EQ(scene.cast({0, 48}, {0, -1}, 60).range_m, 35.5);
  EXPECT_DOUBLE_EQ(scene.cast({10, 2}, {0, 1}, 60).range_m, 0);  // from inside
  const auto past = scene.cast({-12, 4}, {1, 0}, 60);
  EXPECT_FALSE(past.obstacle);
  EXPECT_DOUBLE_EQ(past.range_m, 52);
}

TEST(SceneTest, RaysEndAtTheBorderAndAtTheirRange) {
  const Scene scene = lot_scene();
  const auto west = scene.cast({2, 12}, {-1, 0}, 60);
  EXPECT_FALSE(west.obstacle);
  EXPECT_DOUBLE_EQ(west.range_m, 2);
  const auto east = scene.cast({2, 12}, {1, 0}, 60);
  EXPECT_FALSE(east.obstacle);
  EXPECT_DOUBLE_EQ(east.range_m, 60);
}

TEST(SceneTest, TellsGroundApart) {
  const Scene scene = lot_scene();
  EXPECT_EQ(scene.ground({30, 10}), Ground::kRoad);
  EXPECT_EQ(scene.ground({30, 8.5}), Ground::kMarking);
  EXPECT_EQ(scene.ground({80, 9}), Ground::kMarking);  // the crossing
  EXPECT_EQ(scene.ground({30, 17}), Ground::kBlocked);
  EXPECT_EQ(scene.ground(scene.cars()[0].centre), Ground::kBlocked);
  EXPECT_TRUE(scene.hidden({60, 70}));
  EXPECT_FALSE(scene.hidden({60, 59}));
}

TEST(TownTest, HasHousesRoadAndCarParks) {
  const Scene scene = town_scene();
  const Track road = town_road();
  EXPECT_GT(road.length_m(), 1200);
  int with_houses = 0;
  int places = 0;
  for (double s = 20; s < road.length_m() - 20; s += 5, ++places) {
    const VehiclePose pose = road.at(s).pose;
    EXPECT_NE(scene.ground(pose.position), Ground::kBlocked) << s;
    for (const double side : {-1.0, 1.0}) {
      const auto hit =
          scene.cast(pose.position + side * 7.9 * left_of(pose.heading), side * left_of(pose.heading), 20);
      with_houses += hit.obstacle && hit.range_m < 6;
    }
  }
  EXPECT_GT(with_houses, places);  // of two sides: more than half
  EXPECT_LT(with_houses, 2 * places * 9 / 10);
}

/// The corners of the vehicle stay out of obstacles.
void expect_clear(const Scene& scene, const Drive& drive) {
  for (const VehiclePose& pose : drive.poses) {
    for (const Point corner : {Point{2.2, 0.9}, Point{2.2, -0.9}, Point{-2.2, 0.9}, Point{-2.2, -0.9}}) {
      const Point p = pose.position + turned(corner, pose.heading);
      EXPECT_FALSE(scene.occupied(p)) << p.x_m << ", " << p.y_m;
    }
    EXPECT_NEAR(length(pose.heading), 1, 1e-12);
  }
}

TEST(DriveTest, VehiclesKeepClearOfObstacles) {
  const Scene lot = lot_scene();
  for (const Drive& drive : {drive_a(), drive_b()}) {
    EXPECT_GT(drive.poses.size(), 30u);
    expect_clear(lot, drive);
  }
  for (const std::uint64_t seed : {1u, 2u, 3u}) expect_clear(town_scene(seed), town_drive());
}

TEST(DriveTest, GoesThroughTownAsACarDoes) {
  const Drive drive = town_drive();
  ASSERT_EQ(drive.poses.size(), 4650u);
  const auto speed = [&](std::size_t k) {
    return length(drive.poses[k + 1].position - drive.poses[k].position) / 0.1;
  };
  double fastest = 0;
  for (std::size_t k = 1; k + 1 < drive.poses.size(); ++k) {
    fastest = std::max(fastest, speed(k));
    EXPECT_LT(std::abs(speed(k) - speed(k - 1)), 0.35) << k;  // 3.5 m/s^2
    EXPECT_GT(dot(drive.poses[k].heading, drive.poses[k - 1].heading), 0.99) << k;
    const double time_s = 0.1 * static_cast<double>(k);
    const bool parking = time_s < 155 || time_s > 345;
    EXPECT_LT(speed(k), parking ? 4.17 : 13.9) << k;  // 15 and 50 km/h, as in the paper
  }
  EXPECT_GT(fastest, 13);
  EXPECT_EQ(speed(4600), 0);  // parked
  // At the gates when the requirements change.
  EXPECT_LT(length(drive.poses[1560].position - town_road().at(0).pose.position), 10);
  EXPECT_LT(length(drive.poses[3400].position - town_road().end()), 15);
}

TEST(TrackTest, RunsOnWithoutJumps) {
  Track track({1, 2}, kPi / 6);
  track.forward(10).turn(5, kPi / 2).forward(3).turn(8, -kPi / 3).turn(2, kPi);
  EXPECT_NEAR(track.length_m(), 13 + 5 * kPi / 2 + 8 * kPi / 3 + 2 * kPi, 1e-12);
  for (double s = 0.01; s < track.length_m(); s += 0.01) {
    const VehiclePose here = track.at(s).pose;
    const Point way = here.position - track.at(s - 0.01).pose.position;
    EXPECT_NEAR(length(way), 0.01, 1e-6) << s;
    EXPECT_GT(dot(way, here.heading), 0.01 * (1 - 1e-4)) << s;
  }
  EXPECT_NEAR(track.at(1e9).pose.heading.x_m, std::cos(kPi * (1.0 / 6 + 1.0 / 2 - 1.0 / 3 + 1)), 1e-12);
}

TEST(TimetableTest, StandsAtStopsAndKeepsToLimits) {
  const Track track = Track({0, 0}, 0).forward(100);
  Timetable timetable;
  timetable.limits = {{0, 5}, {60, 2}};
  timetable.stops = {{30, 4}, {80, 1, 60}};
  const auto poses = poses_along(track, timetable, 0.1, 100);
  ASSERT_EQ(poses.size(), 1000u);
  int at_first = 0;
  int at_second = 0;
  for (std::size_t k = 1; k < poses.size(); ++k) {
    const double x = poses[k].position.x_m;
    const double speed = (x - poses[k - 1].position.x_m) / 0.1;
    EXPECT_GE(speed, -1e-9);
    EXPECT_LE(speed, x > 61 ? 2.01 : 5.01);
    at_first += x == 30 && speed == 0;
    at_second += x == 80 && speed == 0;
    EXPECT_LE(x, static_cast<double>(k) * 0.1 < 60 ? 80 : 100);
  }
  EXPECT_NEAR(at_first, 40, 2);
  EXPECT_GT(at_second, 150);
  EXPECT_EQ(poses.back().position.x_m, 100);
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

}  // namespace
}  // namespace apgm::samples
