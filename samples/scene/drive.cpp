#include "scene/drive.hpp"

#include <algorithm>
#include <cmath>

namespace apgm::samples {
namespace {

constexpr double kStep_m = 0.25;  // between the places where the speed is decided

double limit_at(const Timetable& timetable, double s_m) {
  double speed = 0;
  for (const auto& limit : timetable.limits) {
    if (limit.from_m <= s_m) speed = limit.speed_m_s;
  }
  return speed;
}

std::size_t step_at(double s_m) { return static_cast<std::size_t>(std::max(0.0, s_m) / kStep_m + 0.5); }

/// Greatest speed at each step that keeps to limits, bends, stops, acceleration and brakes.
std::vector<double> speeds(const Track& track, const Timetable& timetable) {
  std::vector<double> v(step_at(track.length_m()) + 1);
  for (std::size_t k = 0; k < v.size(); ++k) {
    const double s = static_cast<double>(k) * kStep_m;
    v[k] = limit_at(timetable, s);
    const double bend = std::abs(track.at(s).curvature_per_m);
    if (bend > 0) v[k] = std::min(v[k], std::sqrt(timetable.sideways_m_s2 / bend));
  }
  v.front() = v.back() = 0;
  for (const auto& stop : timetable.stops) v[std::min(v.size() - 1, step_at(stop.at_m))] = 0;
  const double gain = 2 * kStep_m * timetable.accelerates_m_s2;
  const double loss = 2 * kStep_m * timetable.brakes_m_s2;
  for (std::size_t k = 1; k < v.size(); ++k) v[k] = std::min(v[k], std::sqrt(v[k - 1] * v[k - 1] + gain));
  for (std::size_t k = v.size() - 1; k-- > 0;) v[k] = std::min(v[k], std::sqrt(v[k + 1] * v[k + 1] + loss));
  return v;
}

}  // namespace

Track& Track::turn(double radius_m, double angle_rad) {
  return add(radius_m * std::abs(angle_rad), (angle_rad < 0 ? -1 : 1) / radius_m);
}

Track& Track::add(double length_m, double curvature_per_m) {
  pieces_.push_back({end_, heading_rad_, curvature_per_m, length_m_, length_m});
  end_ = pieces_.back().at(length_m);
  heading_rad_ += curvature_per_m * length_m;
  length_m_ += length_m;
  return *this;
}

Point Track::Piece::at(double way_m) const {
  const Point ahead = direction(heading_rad);
  if (curvature_per_m == 0) return start + way_m * ahead;
  const Point then = direction(heading_rad + curvature_per_m * way_m);
  return start + (1 / curvature_per_m) * (left_of(ahead) - left_of(then));
}

Track::Place Track::at(double s_m) const {
  const double s = std::clamp(s_m, 0.0, length_m_);
  auto it = std::upper_bound(pieces_.begin(), pieces_.end(), s,
                             [](double way, const Piece& piece) { return way < piece.begin_m; });
  const Piece& piece = *std::prev(it);
  const double way = s - piece.begin_m;
  return {{piece.at(way), direction(piece.heading_rad + piece.curvature_per_m * way)}, piece.curvature_per_m};
}

std::vector<VehiclePose> poses_along(const Track& track, const Timetable& timetable, double period_s,
                                     double until_s) {
  const std::vector<double> v = speeds(track, timetable);
  std::vector<VehiclePose> poses;
  double time = 0;  // when step k is left
  auto stop = timetable.stops.begin();
  const auto stand_until = [&](double s, double end) {
    while (static_cast<double>(poses.size()) * period_s < std::min(end, until_s)) {
      poses.push_back(track.at(s).pose);
    }
    time = end;
  };
  for (std::size_t k = 0; k + 1 < v.size(); ++k) {
    const double s = static_cast<double>(k) * kStep_m;
    for (; stop != timetable.stops.end() && step_at(stop->at_m) <= k; ++stop) {
      stand_until(s, std::max(time + stop->at_least_s, stop->until_s));
    }
    const double takes = 2 * kStep_m / (v[k] + v[k + 1]);
    const double gains = (v[k + 1] - v[k]) / takes;
    while (static_cast<double>(poses.size()) * period_s < std::min(time + takes, until_s)) {
      const double in_step = static_cast<double>(poses.size()) * period_s - time;
      poses.push_back(track.at(s + in_step * (v[k] + gains * in_step / 2)).pose);
    }
    time += takes;
  }
  stand_until(track.length_m(), until_s);
  return poses;
}

}  // namespace apgm::samples
