#include "scene/town.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "scene/furniture.hpp"
#include "scene/random.hpp"

namespace apgm::samples {
namespace {

constexpr double kLane_m = 1.75;     // a lane's middle from the middle of the road
constexpr double kRoadHalf_m = 6;    // two lanes, a strip of parked cars on either side
constexpr double kParkedAt_m = 4.9;  // middle of the strip
constexpr Point kRoadStart{140, 47.25};
constexpr std::array kCrossings_m{160.0, 420.0, 745.0, 1060.0, 1400.0};  // along the road

struct SideStreet {
  double at_m;  // along the road
  int side;     // 1: to the left
};
constexpr std::array kSideStreets{SideStreet{120, 1},  SideStreet{190, -1},  SideStreet{390, 1},
                                  SideStreet{460, -1}, SideStreet{700, 1},   SideStreet{830, -1},
                                  SideStreet{1020, 1}, SideStreet{1120, -1}, SideStreet{1350, 1}};

// Car parks: aisles along x with bays on both sides, a lane across at both ends.
constexpr int kAisles = 4;
constexpr int kBays = 36;       // in a row
constexpr double kTaken = 0.5;  // share of bays with a car
constexpr double kAislePeriod_m = 17;
constexpr double kAcross_m = 10;
constexpr Point kCarParkSize_m{2 * kAcross_m + kBays * kBayWidth_m, kAisles* kAislePeriod_m};
constexpr Point kCarParkA{25, 20};  // its lower-left corner

double aisle_y(Point car_park, int aisle) { return car_park.y_m + 8.5 + kAislePeriod_m * aisle; }

/// The second aisle of car park B goes on where the right lane ends.
Point car_park_b() {
  const Point end = town_road().end();
  return {end.x_m + 5, end.y_m - kLane_m - 8.5 - kAislePeriod_m};
}

/// Straights and bends of the road: its middle line, or a line to the right of it.
void follow_road(Track& track, double to_the_right_m) {
  const double d = to_the_right_m;
  track.forward(245).turn(60 + d, kPi / 3).forward(220).turn(60 - d, -kPi / 3).forward(320);
  track.turn(80 - d, -kPi / 4).forward(240).turn(80 + d, kPi / 4).forward(240);
}

class Town {
 public:
  explicit Town(std::uint64_t seed)
      : seed_(seed), scene_({{-60, -80}, {1640, 430}}, {-300, -200}), road_(town_road()) {}

  Scene build() {
    add_road();
    for (const SideStreet& street : kSideStreets) add_side_street(street);
    const Point a = kCarParkA;
    const Point b = car_park_b();
    add_car_park(a, 1);
    add_car_park(b, 2);
    add_round_car_park(a, a.x_m + kCarParkSize_m.x_m);
    add_round_car_park(b, b.x_m);
    scene_.add_asphalt(
        rect_of({{kRoadStart.x_m - 6, aisle_y(a, 1) - 4}, {kRoadStart.x_m + 1, aisle_y(a, 1) + 5.25}}));
    scene_.add_asphalt(rect_of({{b.x_m - 6, aisle_y(b, 1) - 4}, {b.x_m + 1, aisle_y(b, 1) + 5.25}}));
    for (const int side : {1, -1}) {
      add_houses(side);
      add_yards(side);
      add_kerb(side);
    }
    return std::move(scene_);
  }

 private:
  /// Draws of one kind of things, so that more of one do not move the others.
  Random draws(std::uint64_t kind) const { return Random(seed_ * 1000 + kind); }

  /// A rectangle along the road, its middle `left_m` to the left of the road's.
  Rect beside(double at_m, double left_m, Point half) const {
    const VehiclePose pose = road_.at(at_m).pose;
    return {pose.position + left_m * left_of(pose.heading), half, pose.heading};
  }

  double from_road(const Rect& rect) const {
    double least = kNoHit;
    for (double s = 0; s <= road_.length_m(); s += 2) {
      least = std::min(least, distance(rect, road_.at(s).pose.position));
    }
    return least;
  }

  static double gap_to_side_street(double at_m, int side) {
    double least = kNoHit;
    for (const auto& street : kSideStreets) {
      if (street.side == side) least = std::min(least, std::abs(at_m - street.at_m));
    }
    return least;
  }

  static double gap_to_crossing(double at_m) {
    double least = kNoHit;
    for (const double crossing : kCrossings_m) least = std::min(least, std::abs(at_m - crossing));
    return least;
  }

  /// True if nothing stands where `rect` is to be, and no street runs there.
  bool is_free(const Rect& rect) const {
    const int along = static_cast<int>(rect.half.x_m) + 1;
    const int across = static_cast<int>(rect.half.y_m) + 1;
    for (int i = -along; i <= along; ++i) {
      for (int j = -across; j <= across; ++j) {
        const Point p{rect.half.x_m * i / along, rect.half.y_m * j / across};
        const Point q = rect.centre + turned(p, rect.axis);
        if (!contains(scene_.bounds(), q) || scene_.hidden(q) || scene_.occupied(q)) return false;
        if (scene_.ground(q) != Ground::kBlocked) return false;
      }
    }
    return true;
  }

  /// False if it has no room.
  bool add_house(const Rect& outside, double from_road_m) {
    if (from_road(outside) < from_road_m || !is_free(outside)) return false;
    add_building(scene_, outside);
    return true;
  }

  void add_road() {
    for (double s = 0; s < road_.length_m(); s += 2) {
      scene_.add_asphalt(beside(s + 1, 0, {1.3, kRoadHalf_m}));
      for (const double left : {-3.6, 3.6}) {
        if (gap_to_crossing(s) > 4) scene_.add_paint(beside(s + 1, left, {1.02, kLine_m / 2}));
      }
    }
    for (double s = 2; s < road_.length_m(); s += 8) {
      if (gap_to_crossing(s) > 6) scene_.add_paint(beside(s, 0, {1.5, kLine_m / 2}));
    }
    for (const double s : kCrossings_m) {
      for (double left = -5.4; left < 5.7; left += 1.2) scene_.add_paint(beside(s, left, {2, 0.3}));
    }
  }

  void add_side_street(const SideStreet& street) {
    constexpr double kLength_m = 90;
    const VehiclePose road = road_.at(street.at_m).pose;
    const Point out = static_cast<double>(street.side) * left_of(road.heading);
    const auto at = [&](double out_m, double across_m, Point half) {
      return Rect{road.position + out_m * out + across_m * left_of(out), half, out};
    };
    scene_.add_asphalt(at(kRoadHalf_m + kLength_m / 2, 0, {kLength_m / 2, 3.2}));
    for (double d = 10; d < kLength_m; d += 8) scene_.add_paint(at(d, 0, {1.5, kLine_m / 2}));
    add_house(at(kRoadHalf_m + kLength_m + 8, 0, {6, 9}), 20);
    Random random = draws(static_cast<std::uint64_t>(400 + street.at_m / 10));
    for (const int side : {1, -1}) {
      for (double d = 30; d < kLength_m;) {
        const double half = 5 + 4 * random.uniform();
        const double depth = 4 + 2 * random.uniform();
        const double setback = 6 + 2 * random.uniform();
        add_house(at(d + half, side * (setback + depth), {half, depth}), 25);
        d += 2 * half + 2 + 6 * random.uniform();
      }
      for (double d = 12; d < kLength_m; d += 7) {
        if (random.uniform() < 0.3) scene_.add_car(at(d, side * 2.2, {2.1, 0.9}));
      }
    }
  }

  /// The row of houses along the road.
  void add_houses(int side) {
    Random random = draws(side > 0 ? 1 : 2);
    for (double s = 5; s < road_.length_m() - 5;) {
      const double half = 6 + 8 * random.uniform();
      const double depth = 5 + 2 * random.uniform();
      const double setback = 9 + 3.5 * random.uniform();
      const bool wide_gap = random.uniform() < 0.4;
      const double gap = wide_gap ? 8 + 8 * random.uniform() : 1.5 + 4 * random.uniform();
      const bool stands = gap_to_side_street(s + half, side) > half + 7 &&
                          add_house(beside(s + half, side * (setback + depth), {half, depth}), 8.5);
      s += stands ? 2 * half + gap : 3;
    }
  }

  /// What is seen through the gaps: sheds, trees, and the walls that close the yards.
  void add_yards(int side) {
    Random random = draws(side > 0 ? 3 : 4);
    for (double s = 10; s < road_.length_m() - 10; s += 12) {
      const double wall_at = 30 + 3 * random.uniform();
      const Point shed_at{s + 4 * random.bell(), side * (25 + 2 * random.uniform())};
      const Point tree_at{s + 4 * random.bell(), side * (23 + 6 * random.uniform())};
      const Rect wall = beside(s, side * wall_at, {6.3, 0.15});
      const Rect shed = beside(shed_at.x_m, shed_at.y_m, {2, 1.5});
      const Rect tree = beside(tree_at.x_m, tree_at.y_m, {0.4, 0.4});
      if (random.uniform() < 0.9 && from_road(wall) > 20 && is_free(wall)) scene_.add_wall(wall);
      if (random.uniform() < 0.4) add_house(shed, 20);
      if (is_free(tree) && from_road(tree) > 15) scene_.add_post({tree.centre, 0.3});
    }
  }

  /// Parked cars, trees and poles along the road.
  void add_kerb(int side) {
    Random random = draws(side > 0 ? 5 : 6);
    for (double s = 12; s < road_.length_m() - 12; s += 6) {
      const bool taken = random.uniform() < 0.5;
      const double shift = 0.3 * random.bell();
      const Point half{2.0 + 0.3 * random.uniform(), 0.85 + 0.1 * random.uniform()};
      if (!taken || gap_to_crossing(s) < 10 || gap_to_side_street(s, side) < 9) continue;
      scene_.add_car(beside(s + shift, side * kParkedAt_m, half));
    }
    for (double s = 9; s < road_.length_m(); s += 14) {
      const bool tree = random.uniform() < 0.7;
      const Rect foot = beside(s, side * 7.2, {0.4, 0.4});
      if (gap_to_side_street(s, side) < 6 || gap_to_crossing(s) < 4 || !is_free(foot)) continue;
      scene_.add_post({foot.centre, tree ? 0.3 : 0.1});
    }
  }

  void add_car_park(Point corner, std::uint64_t which) {
    scene_.add_asphalt(rect_of({corner, corner + kCarParkSize_m}));
    // The bays where the drive ends (town_drive).
    const Point last{corner.x_m + 51.25, aisle_y(corner, 1) - 6};
    const Box keep_free = which == 2 ? Box{last - Point{3.8, 1}, last + Point{3.8, 1}} : Box{};
    const double left = corner.x_m + kAcross_m;
    const double right = left + kBays * kBayWidth_m;
    for (int aisle = 0; aisle < kAisles; ++aisle) {
      const double y = aisle_y(corner, aisle);
      const auto seed = seed_ * 1000 + 10 * which + 2 * static_cast<std::uint64_t>(aisle) + 200;
      add_bays(scene_, {left, y - 8.5}, kBays, kTaken, seed, keep_free);
      add_bays(scene_, {left, y + 3.5}, kBays, kTaken, seed + 1, keep_free);
      if (aisle == 0) continue;
      // Kerb stones at the ends of the double row.
      for (const double x : {left - 0.5, right + 0.2}) {
        scene_.add_wall(rect_of({{x, y - 13.5}, {x + 0.3, y - 3.5}}));
      }
    }
  }

  /// Posts, trees and houses round a car park that is entered at `gate_x_m`.
  void add_round_car_park(Point corner, double gate_x_m) {
    const Box lot{corner, corner + kCarParkSize_m};
    const auto post = [&](Point p) {
      const bool gate = std::abs(p.x_m - gate_x_m) < 2 && std::abs(p.y_m - aisle_y(corner, 1)) < 7;
      if (!gate) scene_.add_post({p, 0.12});
    };
    for (double x = lot.min.x_m; x <= lot.max.x_m; x += 3) {
      post({x, lot.min.y_m - 0.8});
      post({x, lot.max.y_m + 0.8});
    }
    for (double y = lot.min.y_m; y <= lot.max.y_m; y += 3) {
      post({lot.min.x_m - 0.8, y});
      post({lot.max.x_m + 0.8, y});
    }
    for (double x = lot.min.x_m; x <= lot.max.x_m - 20; x += 32) {
      for (const double y : {lot.min.y_m - 22, lot.max.y_m + 22}) {
        add_house(rect_of({{x, y - 6}, {x + 22, y + 6}}), 12);
        scene_.add_post({{x + 27, y}, 0.3});
      }
    }
    const double outer_x = gate_x_m == lot.min.x_m ? lot.max.x_m + 18 : lot.min.x_m - 18;
    for (double y = lot.min.y_m; y <= lot.max.y_m - 18; y += 26) {
      add_house(rect_of({{outer_x - 5, y}, {outer_x + 5, y + 18}}), 12);
    }
  }

  std::uint64_t seed_;
  Scene scene_;
  Track road_;
};

}  // namespace

Scene town_scene(std::uint64_t seed) { return Town(seed).build(); }

Track town_road() {
  Track road(kRoadStart, 0);
  follow_road(road, 0);
  return road;
}

Drive town_drive() {
  constexpr double kQuarter = kPi / 2;
  constexpr double kCorner_m = 6;
  // From the fourth aisle of car park A up and down to the gate at the second.
  Track track({75, aisle_y(kCarParkA, 3)}, kPi);
  track.forward(39).turn(kCorner_m, kQuarter).forward(5).turn(kCorner_m, kQuarter).forward(88);
  track.turn(kCorner_m, -kQuarter).forward(5).turn(kCorner_m, -kQuarter).forward(88);
  track.turn(kCorner_m, kQuarter).forward(5).turn(kCorner_m, kQuarter).forward(88);
  track.turn(kCorner_m, kQuarter).forward(5);
  track.turn(kCorner_m, -kQuarter);
  const double gate_a_m = track.length_m() - 1;
  track.forward(kRoadStart.x_m - track.end().x_m);
  const double road_m = track.length_m();
  follow_road(track, kLane_m);
  const double gate_b_m = track.length_m();
  // Once round two aisles of car park B and into a bay of the first row below the second aisle.
  track.forward(104).turn(kCorner_m, kQuarter).forward(5).turn(kCorner_m, kQuarter).forward(88);
  track.turn(kCorner_m, kQuarter).forward(5).turn(kCorner_m, kQuarter).forward(35.75);
  track.turn(4.5, -kQuarter).forward(1.5);

  Timetable timetable;
  timetable.limits = {{0, 3.1}, {road_m, 13.5}, {gate_b_m - 3, 3.1}};
  timetable.stops = {{0, 8},
                     {gate_a_m, 2, 155},
                     {road_m + kCrossings_m[1] - 6, 12},
                     {road_m + kCrossings_m[3] - 6, 12},
                     {road_m + kCrossings_m[4] - 6, 5, 326}};
  Drive drive;
  drive.period_ns = 100'000'000;
  drive.poses = poses_along(track, timetable, 0.1, 465);
  return drive;
}

}  // namespace apgm::samples
