#include "scene/scene.hpp"

#include <algorithm>

namespace apgm::samples {
namespace {

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

Frame sample_frame() {
  Frame frame;
  frame.datum_x_um = 570'000'000'000;
  frame.datum_y_um = 5'360'000'000'000;
  frame.epsg = 32632;
  frame.frame_id = "utm";
  return frame;
}

Scene::Scene(const Box& bounds, Point origin_m)
    : bounds_(bounds),
      origin_in_map_m_(sample_frame().datum_m() + origin_m),
      obstacle_grid_(bounds),
      floor_grid_(bounds) {}

void Scene::add_obstacle(const Obstacle& obstacle, const Box& box) {
  obstacle_grid_.add(box, static_cast<std::uint32_t>(obstacles_.size()));
  obstacles_.push_back(obstacle);
}

void Scene::add_floor(Floor::Kind kind, const Rect& area) {
  floor_grid_.add(samples::bounds(area), static_cast<std::uint32_t>(floors_.size()));
  floors_.push_back({kind, area});
}

void Scene::add_wall(const Rect& rect) { add_obstacle(rect, samples::bounds(rect)); }

void Scene::add_car(const Rect& rect) {
  add_obstacle(rect, samples::bounds(rect));
  cars_.push_back(rect);
}

void Scene::add_post(const Disc& disc) { add_obstacle(disc, samples::bounds(disc)); }

void Scene::add_inside(const Rect& rect) { add_floor(Floor::Kind::kInside, rect); }

void Scene::add_asphalt(const Rect& rect) { add_floor(Floor::Kind::kAsphalt, rect); }

void Scene::add_paint(const Rect& rect) { add_floor(Floor::Kind::kPaint, rect); }

Scene::Hit Scene::cast(Point origin, Point direction, double max_range_m) const {
  const double limit = std::min(max_range_m, to_border(bounds_, origin, direction));
  double nearest = kNoHit;
  obstacle_grid_.along(origin, direction, [&](std::span<const std::uint32_t> ids, double leaves_m) {
    for (const std::uint32_t id : ids) {
      const auto enter = [&](const auto& shape) { return samples::cast(shape, origin, direction); };
      nearest = std::min(nearest, std::visit(enter, obstacles_[id]));
    }
    // What lies in later squares only is entered later.
    return leaves_m < std::min(nearest, limit);
  });
  return nearest < limit ? Hit{nearest, true} : Hit{limit, false};
}

bool Scene::occupied(Point p) const {
  const auto ids = obstacle_grid_.at(p);
  return std::any_of(ids.begin(), ids.end(), [&](std::uint32_t id) {
    return std::visit([&](const auto& shape) { return contains(shape, p); }, obstacles_[id]);
  });
}

bool Scene::hidden(Point p) const {
  const auto ids = floor_grid_.at(p);
  return std::any_of(ids.begin(), ids.end(), [&](std::uint32_t id) {
    return floors_[id].kind == Floor::Kind::kInside && contains(floors_[id].area, p);
  });
}

Ground Scene::ground(Point p) const {
  bool asphalt = false;
  bool paint = false;
  for (const std::uint32_t id : floor_grid_.at(p)) {
    const Floor& floor = floors_[id];
    if (!contains(floor.area, p)) continue;
    if (floor.kind == Floor::Kind::kInside) return Ground::kBlocked;
    (floor.kind == Floor::Kind::kPaint ? paint : asphalt) = true;
  }
  if (!asphalt || occupied(p)) return Ground::kBlocked;
  return paint ? Ground::kMarking : Ground::kRoad;
}

}  // namespace apgm::samples
