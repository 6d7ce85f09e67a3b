#pragma once

#include <cstdint>
#include <vector>

#include "apgm/core/frame.hpp"
#include "scene/geometry.hpp"

namespace apgm::samples {

/// Where a vehicle stands, in scene metres, and a unit vector along its nose.
struct VehiclePose {
  Point position;
  Point heading{1, 0};
};

/// A vehicle on its way through a scene: one pose for each measurement.
struct Drive {
  std::vector<VehiclePose> poses;
  std::int64_t start_ns = 0;
  std::int64_t period_ns = 250'000'000;

  std::int64_t stamp_ns(std::size_t pose) const {
    return start_ns + static_cast<std::int64_t>(pose) * period_ns;
  }
};

/// A smooth line on the ground: straights and arcs, one after the other.
class Track {
 public:
  Track(Point start, double heading_rad) : end_(start), heading_rad_(heading_rad) {}
  Track& forward(double length_m) { return add(length_m, 0); }
  /// Along a circle, to the left for a positive angle.
  Track& turn(double radius_m, double angle_rad);

  struct Place {
    VehiclePose pose;
    double curvature_per_m = 0;  ///< positive to the left
  };
  /// @param s_m  way from the start, clamped to the track
  Place at(double s_m) const;
  double length_m() const { return length_m_; }
  Point end() const { return end_; }

 private:
  struct Piece {
    Point start;
    double heading_rad, curvature_per_m, begin_m, length_m;
    Point at(double way_m) const;
  };
  Track& add(double length_m, double curvature_per_m);

  std::vector<Piece> pieces_;
  Point end_;
  double heading_rad_;
  double length_m_ = 0;
};

/// How fast a vehicle goes along its track.
struct Timetable {
  struct Limit {
    double from_m, speed_m_s;
  };
  struct Stop {
    double at_m;
    double at_least_s;   ///< stands this long
    double until_s = 0;  ///< and not less than until then
  };
  std::vector<Limit> limits;  ///< ascending, the first from 0
  std::vector<Stop> stops;    ///< ascending
  double accelerates_m_s2 = 1.5;
  double brakes_m_s2 = 2.0;
  double sideways_m_s2 = 1.5;  ///< in bends
};

/// Poses every `period_s` from 0 to less than `until_s`; the vehicle stands at the end of its track.
std::vector<VehiclePose> poses_along(const Track& track, const Timetable& timetable, double period_s,
                                     double until_s);

}  // namespace apgm::samples
