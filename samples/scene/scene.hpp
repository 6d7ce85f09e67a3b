#pragma once

#include <cstdint>
#include <vector>

#include "apgm/core/frame.hpp"
#include "scene/geometry.hpp"

namespace apgm::samples {

/// What a camera tells of a piece of ground.
enum class Ground : std::uint8_t {
  kRoad,     ///< drivable: road, parking lot, driveway
  kMarking,  ///< painted: lane and bay lines, zebra crossing
  kBlocked,  ///< not drivable: pavement, lawn, buildings, cars, kerb stones
};

/// A parking lot beside a road, seen from above, 120 m x 80 m: three rows of bays with parked cars, kerb
/// stones at their ends, an arcade of pillars along a closed building, a road with two lanes and a crossing,
/// poles, trees and a house on the other side. Nothing moves.
///
/// Coordinates are metres from the scene's lower-left corner. Guarantee: same geometry for the same seed.
class Scene {
 public:
  static constexpr Box kBounds{{0, 0}, {120, 80}};

  /// @param seed  decides which bays are taken and how cars stand in them
  explicit Scene(std::uint64_t seed = 1);

  struct Hit {
    double range_m = 0;
    bool obstacle = false;  ///< false: the ray left the scene or came to `max_range_m`
  };
  /// First obstacle along a ray from inside the bounds; `direction` is a unit vector.
  Hit cast(Point origin, Point direction, double max_range_m) const;

  /// True inside an obstacle: wall, pillar, car, kerb stone, pole, trunk.
  bool occupied(Point p) const;
  /// True inside the walls of a building, where no sensor sees.
  bool hidden(Point p) const;
  Ground ground(Point p) const;

  const std::vector<Rect>& cars() const { return cars_; }

 private:
  void add_road();
  void add_lot(std::uint64_t seed);
  void add_buildings();
  void add_round_things();
  void add_building(const Box& outside);
  void add_bays(double x_min_m, double x_max_m, double y_min_m, std::uint64_t seed);

  std::vector<Rect> cars_;
  std::vector<Rect> walls_;  // walls, pillars, kerb stones
  std::vector<Disc> discs_;  // poles, trunks
  std::vector<Box> hidden_;  // inside of buildings
  std::vector<Box> asphalt_;
  std::vector<Box> paint_;
};

}  // namespace apgm::samples
