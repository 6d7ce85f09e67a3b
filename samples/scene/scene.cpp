#include "scene/scene.hpp"

#include <algorithm>

#include "scene/random.hpp"

namespace apgm::samples {
namespace {

constexpr double kBayWidth_m = 2.5;
constexpr double kBayDepth_m = 5.0;
constexpr double kLine_m = 0.2;
constexpr double kWall_m = 0.3;

Rect rect_of(const Box& box) { return {0.5 * (box.min + box.max), 0.5 * (box.max - box.min), {1, 0}}; }

template <class Shapes>
bool any_contains(const Shapes& shapes, Point p) {
  return std::any_of(shapes.begin(), shapes.end(), [&](const auto& s) { return contains(s, p); });
}

template <class Shapes>
double nearest(const Shapes& shapes, Point origin, Point direction) {
  double best = kNoHit;
  for (const auto& s : shapes) best = std::min(best, cast(s, origin, direction));
  return best;
}

/// Distance to the border of the bounds, from inside.
double to_border(const Box& bounds, Point origin, Point direction) {
  double far = kNoHit;
  if (direction.x_m > 0) far = std::min(far, (bounds.max.x_m - origin.x_m) / direction.x_m);
  if (direction.x_m < 0) far = std::min(far, (bounds.min.x_m - origin.x_m) / direction.x_m);
  if (direction.y_m > 0) far = std::min(far, (bounds.max.y_m - origin.y_m) / direction.y_m);
  if (direction.y_m < 0) far = std::min(far, (bounds.min.y_m - origin.y_m) / direction.y_m);
  return far;
}

}  // namespace

Scene::Scene(std::uint64_t seed) {
  add_road();
  add_lot(seed);
  add_buildings();
  add_round_things();
}

void Scene::add_road() {
  asphalt_.push_back({{0, 8}, {120, 16}});
  paint_.push_back({{0, 8.4}, {120, 8.4 + kLine_m}});
  paint_.push_back({{0, 15.4}, {120, 15.4 + kLine_m}});
  for (double x = 1; x < 120; x += 6) {
    if (x > 76 && x < 86) continue;  // the crossing
    paint_.push_back({{x, 12 - kLine_m / 2}, {x + 3, 12 + kLine_m / 2}});
  }
  for (double y = 8.9; y < 15; y += 1.2) paint_.push_back({{79, y}, {83, y + 0.6}});
}

void Scene::add_lot(std::uint64_t seed) {
  asphalt_.push_back({{14, 20}, {104, 55}});
  asphalt_.push_back({{52, 16}, {60, 20}});  // driveway
  add_bays(16, 51, 20, seed);
  add_bays(61, 102, 20, seed + 1);
  add_bays(21, 96, 32, seed + 2);
  add_bays(21, 96, 37, seed + 3);
  add_bays(16, 102, 49, seed + 4);
  paint_.push_back({{21, 37 - kLine_m / 2}, {96, 37 + kLine_m / 2}});
  // Kerb stones close the ends of the middle rows and flank the driveway.
  for (const double x : {20.0, 96.4}) walls_.push_back(rect_of({{x, 32}, {x + 0.3, 42}}));
  for (const double x : {51.4, 60.3}) walls_.push_back(rect_of({{x, 18}, {x + 0.3, 25}}));
}

void Scene::add_bays(double x_min_m, double x_max_m, double y_min_m, std::uint64_t seed) {
  Random random(seed);
  for (double x = x_min_m; x <= x_max_m; x += kBayWidth_m) {
    paint_.push_back({{x - kLine_m / 2, y_min_m}, {x + kLine_m / 2, y_min_m + kBayDepth_m}});
    if (x + kBayWidth_m > x_max_m) break;
    // All draws happen for every bay, so that one bay does not decide how the next one looks.
    const bool taken = random.uniform() < 0.7;
    const Point shift{0.15 * random.bell(), 0.2 * random.bell()};
    const double slope = 0.03 * random.bell();
    const double half_length = 2.0 + 0.4 * random.uniform();
    const double half_width = 0.85 + 0.1 * random.uniform();
    if (!taken) continue;
    const Point centre{x + kBayWidth_m / 2, y_min_m + kBayDepth_m / 2};
    cars_.push_back({centre + 0.5 * shift, {half_length, half_width}, unit({slope, 1})});
  }
}

void Scene::add_buildings() {
  add_building({{28, 61}, {92, 77}});
  for (double x = 28; x <= 92; x += 5.333) walls_.push_back(rect_of({{x - 0.25, 57}, {x + 0.25, 57.5}}));
  add_building({{70, 0.5}, {114, 4.5}});
  walls_.push_back(rect_of({{6, 20}, {6 + kWall_m, 70}}));
}

void Scene::add_building(const Box& outside) {
  const Point a = outside.min;
  const Point b = outside.max;
  walls_.push_back(rect_of({a, {b.x_m, a.y_m + kWall_m}}));
  walls_.push_back(rect_of({{a.x_m, b.y_m - kWall_m}, b}));
  walls_.push_back(rect_of({a, {a.x_m + kWall_m, b.y_m}}));
  walls_.push_back(rect_of({{b.x_m - kWall_m, a.y_m}, b}));
  hidden_.push_back({{a.x_m + kWall_m, a.y_m + kWall_m}, {b.x_m - kWall_m, b.y_m - kWall_m}});
}

void Scene::add_round_things() {
  for (double x = 5; x < 120; x += 15) discs_.push_back({{x, 17}, 0.12});
  for (double x = 4; x < 66; x += 9) discs_.push_back({{x, 4.5}, 0.35});
  for (double y = 22; y < 72; y += 8) discs_.push_back({{110, y}, 0.3});
  for (double x = 10; x < 26; x += 5) discs_.push_back({{x, 66}, 0.4});
}

Scene::Hit Scene::cast(Point origin, Point direction, double max_range_m) const {
  const double range = std::min({nearest(cars_, origin, direction), nearest(walls_, origin, direction),
                                 nearest(discs_, origin, direction)});
  const double limit = std::min(max_range_m, to_border(kBounds, origin, direction));
  return range < limit ? Hit{range, true} : Hit{limit, false};
}

bool Scene::occupied(Point p) const {
  return any_contains(walls_, p) || any_contains(cars_, p) || any_contains(discs_, p);
}

bool Scene::hidden(Point p) const { return any_contains(hidden_, p); }

Ground Scene::ground(Point p) const {
  if (!any_contains(asphalt_, p) || hidden(p) || occupied(p)) return Ground::kBlocked;
  return any_contains(paint_, p) ? Ground::kMarking : Ground::kRoad;
}

}  // namespace apgm::samples
