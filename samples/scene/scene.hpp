#pragma once

#include <cstdint>
#include <variant>
#include <vector>

#include "apgm/core/frame.hpp"
#include "scene/geometry.hpp"
#include "scene/shape_grid.hpp"

namespace apgm::samples {

/// What a camera tells of a piece of ground, in the order of the classes of the `semantics` layer.
enum class Ground : std::uint8_t {
  kRoad,     ///< drivable: road, parking lot, driveway
  kMarking,  ///< painted: lane and bay lines, zebra crossing
  kBlocked,  ///< not drivable: pavement, lawn, buildings, cars, kerb stones
};

/// A piece of the world seen from above: obstacles that stop a lidar, ground that a camera tells apart.
/// Nothing moves. Empty, all of it Blocked, until shapes are added.
///
/// Coordinates are metres of its own; `in_map` takes them to the CRS of the sample maps.
class Scene {
 public:
  /// @param origin_m  of the scene's coordinates, from the datum of sample_frame()
  Scene(const Box& bounds, Point origin_m);

  void add_wall(const Rect& rect);  ///< walls, pillars, kerb stones
  void add_car(const Rect& rect);
  void add_post(const Disc& disc);     ///< poles, trunks
  void add_inside(const Rect& rect);   ///< of a building, where no sensor sees
  void add_asphalt(const Rect& rect);  ///< Road, where nothing else is
  void add_paint(const Rect& rect);    ///< Marking, where it lies on asphalt

  struct Hit {
    double range_m = 0;
    bool obstacle = false;  ///< false: the ray left the scene or came to `max_range_m`
  };
  /// First obstacle along a ray from inside the bounds; `direction` is a unit vector.
  Hit cast(Point origin, Point direction, double max_range_m) const;

  /// True inside an obstacle: wall, pillar, car, kerb stone, pole, trunk.
  bool occupied(Point p) const;
  /// True inside the walls of a building.
  bool hidden(Point p) const;
  Ground ground(Point p) const;

  const Box& bounds() const { return bounds_; }
  const std::vector<Rect>& cars() const { return cars_; }
  Point in_map(Point p) const { return p + origin_in_map_m_; }
  Point from_map(Point p) const { return p - origin_in_map_m_; }

 private:
  using Obstacle = std::variant<Rect, Disc>;
  struct Floor {
    enum class Kind : std::uint8_t { kAsphalt, kPaint, kInside } kind;
    Rect area;
  };
  void add_obstacle(const Obstacle& obstacle, const Box& box);
  void add_floor(Floor::Kind kind, const Rect& area);

  Box bounds_;
  Point origin_in_map_m_;
  std::vector<Obstacle> obstacles_;
  std::vector<Floor> floors_;
  std::vector<Rect> cars_;  // among the obstacles, too
  ShapeGrid obstacle_grid_;
  ShapeGrid floor_grid_;
};

/// UTM zone 32 north, datum (570000, 5360000), 12.8 m patches.
Frame sample_frame();

}  // namespace apgm::samples
