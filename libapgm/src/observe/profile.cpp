#include "apgm/observe/profile.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "apgm/core/error.hpp"
#include "apgm/core/layer.hpp"
#include "observe/grid_point.hpp"
#include "observe/parameters.hpp"

namespace apgm {
namespace {

using observe::GridPoint;
using observe::number_text;
using Wide = __int128;

constexpr double kMaxHorizon_m = 1e6;

/// How near and how far the points of [low, high] lie from 0.
struct Distances {
  Wide near, far;
};
Distances distances(Wide low, Wide high) {
  const Wide near = low > 0 ? low : high < 0 ? -high : Wide{0};
  return {near, std::max(-low, high)};
}

/// True if the closed square of `patch` meets the ring round `vehicle`.
bool meets(const Ring& ring, const GridPoint& vehicle, std::int64_t edge_nm, PatchIndex patch) {
  const auto along = [&](std::int32_t index, std::int64_t at) {
    const Wide low = static_cast<Wide>(index) * edge_nm - at;
    return distances(low, low + edge_nm);
  };
  const Distances x = along(patch.x, vehicle.x), y = along(patch.y, vehicle.y);
  const Wide to = observe::nanometres(ring.to_m), from = observe::nanometres(ring.from_m);
  if (x.near > to || y.near > to) return false;
  if (x.near * x.near + y.near * y.near > to * to) return false;
  if (x.far >= from || y.far >= from) return true;
  return x.far * x.far + y.far * y.far >= from * from;
}

GridPoint checked_vehicle(const Frame& frame, Point vehicle) {
  const auto point = observe::grid_point(frame, vehicle);
  if (point) return *point;
  throw Error(observe::is_finite(vehicle) ? ErrorCode::kLimit : ErrorCode::kInvalidArgument,
              "the position of the vehicle is not a number within all patch indices");
}

/// Patches whose closed squares meet the square of half side `to_m` round the vehicle.
PatchRange range_of(const Ring& ring, const GridPoint& vehicle, std::int64_t edge_nm) {
  const std::int64_t to = observe::nanometres(ring.to_m);
  const auto clamp = [](std::int64_t i) {
    return static_cast<std::int32_t>(std::clamp<std::int64_t>(i, std::numeric_limits<std::int32_t>::min(),
                                                              std::numeric_limits<std::int32_t>::max()));
  };
  // A patch that ends at v - to exactly still meets it.
  const auto low = [&](std::int64_t v) { return clamp(floor_div(v - to - 1, edge_nm)); };
  const auto high = [&](std::int64_t v) { return clamp(floor_div(v + to, edge_nm)); };
  return {{low(vehicle.x), low(vehicle.y)}, {high(vehicle.x), high(vehicle.y)}};
}

[[noreturn]] void refuse(const Profile& profile, const Requirement& r, const std::string& why,
                         const std::string& hint) {
  const std::string name = profile.name.empty() ? "" : " '" + profile.name + "'";
  throw Error(ErrorCode::kInvalidArgument, "profile" + name + ": layer '" + r.layer + "' " + why).hint(hint);
}

std::string names_of(const TypeTable& types) {
  std::string names;
  for (const LayerType& type : types) names += (names.empty() ? "" : ", ") + type.name;
  return names;
}

void check_cell(const Profile& profile, const Requirement& r, const Frame& frame) {
  const double edge_m = frame.edge_m();
  for (int step = 0; step <= kMaxStep; ++step) {
    if (std::fabs(frame.cell_m(step) - r.cell_m) <= 1e-9 * r.cell_m) return;
  }
  const std::string why = "wants cells of " + number_text(r.cell_m) +
                          " m, which is no power-of-two part of the edge, " + number_text(edge_m) + " m";
  const bool in_reach = r.cell_m > frame.cell_m(kMaxStep) && r.cell_m < edge_m;
  refuse(profile, r, why,
         in_reach ? "the nearest below is " + number_text(frame.cell_m(frame.step_for(r.cell_m))) + " m"
                  : "cells lie between edge / 2^11 and the edge");
}

void check_size(const Profile& profile, const Requirement& r, const Frame& frame, const LayerType& type) {
  const auto bytes_at = [&](int step) { return (std::size_t{4} << (2 * step)) * type.channels.size(); };
  int step = frame.step_for(r.cell_m);
  if (bytes_at(step) <= Layer::kMaxBytes) return;
  while (bytes_at(step) > Layer::kMaxBytes) --step;
  refuse(profile, r,
         "wants cells of " + number_text(r.cell_m) + " m: a patch of its " +
             std::to_string(type.channels.size()) + " channels would exceed " +
             std::to_string(Layer::kMaxBytes >> 20) + " MiB",
         "the smallest it can have are " + number_text(frame.cell_m(step)) + " m");
}

void check_ring(const Profile& profile, const Requirement& r, const Ring& ring) {
  if (ring.from_m >= 0 && ring.from_m < ring.to_m && ring.to_m <= kMaxHorizon_m) return;
  refuse(profile, r, "has a ring from " + number_text(ring.from_m) + " m to " + number_text(ring.to_m) + " m",
         "0 <= from < to <= 1e6 m");
}

/// True if all corners lie on one line, as PolygonArea sees them.
bool is_line(const std::vector<Point>& ring) {
  struct Offset {
    Wide x, y;
  };
  const auto from_first = [&](const Point& p) {
    return Offset{Wide{to_micrometres(p.x_m)} - to_micrometres(ring[0].x_m),
                  Wide{to_micrometres(p.y_m)} - to_micrometres(ring[0].y_m)};
  };
  Offset along{0, 0};
  for (const Point& p : ring) {
    const Offset o = from_first(p);
    if (along.x == 0 && along.y == 0) along = o;
    if (along.x * o.y != along.y * o.x) return false;
  }
  return true;
}

void check_polygon(const Profile& profile, const Requirement& r, const Polygon& polygon, const Frame& frame) {
  try {
    const PolygonArea in_frame(polygon, frame);  // vertices and numbers
  } catch (const Error& error) {
    refuse(profile, r, "has a polygon that cannot be used: " + error.message(), error.hint());
  }
  if (polygon.rings.empty() || std::ranges::any_of(polygon.rings, is_line)) {
    refuse(profile, r, "has a polygon without area", "give three or more corners not on a line");
  }
}

void check_overlaps(const Profile& profile) {
  const auto& all = profile.requirements;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Ring* const a = std::get_if<Ring>(&all[i].area);
    for (std::size_t k = i + 1; a != nullptr && k < all.size(); ++k) {
      const Ring* const b = std::get_if<Ring>(&all[k].area);
      if (b == nullptr || all[i].layer != all[k].layer) continue;
      if (a->to_m <= b->from_m || b->to_m <= a->from_m) continue;
      refuse(profile, all[k],
             "has overlapping bands: " + number_text(a->from_m) + ".." + number_text(a->to_m) + " m and " +
                 number_text(b->from_m) + ".." + number_text(b->to_m) + " m",
             "let each band begin where the one before ends");
    }
  }
}

}  // namespace

ProfileInFrame::ProfileInFrame(const Profile& profile, const Frame& frame) : frame_(frame) {
  for (const Requirement& r : profile.requirements) {
    Area area{r.layer, frame.step_for(r.cell_m), Ring{}};
    if (const Ring* const ring = std::get_if<Ring>(&r.area)) {
      check_ring(profile, r, *ring);
      area.shape = *ring;
    } else {
      area.shape = PolygonArea(std::get<Polygon>(r.area), frame);
    }
    areas_.push_back(std::move(area));
  }
}

std::optional<int> ProfileInFrame::required_step(PatchIndex patch, std::string_view layer,
                                                 Point vehicle) const {
  const GridPoint at = checked_vehicle(frame_, vehicle);
  std::optional<int> step;
  for (const Area& area : areas_) {
    if (area.layer != layer || (step && *step >= area.step)) continue;
    const Ring* const ring = std::get_if<Ring>(&area.shape);
    const bool met = ring != nullptr
                         ? meets(*ring, at, observe::edge_nm(frame_), patch)
                         : std::get<PolygonArea>(area.shape).cover(patch) != PolygonArea::Cover::kNone;
    if (met) step = area.step;
  }
  return step;
}

PatchRange ProfileInFrame::reach(Point vehicle) const {
  const GridPoint at = checked_vehicle(frame_, vehicle);
  PatchRange range;
  for (const Area& area : areas_) {
    const Ring* const ring = std::get_if<Ring>(&area.shape);
    range.add(ring != nullptr ? range_of(*ring, at, observe::edge_nm(frame_))
                              : std::get<PolygonArea>(area.shape).range());
  }
  return range;
}

void Profile::check(const Frame& frame, const TypeTable& types) const {
  for (const Requirement& r : requirements) {
    const std::optional<TypeId> type = types.find(r.layer);
    if (!type) {
      refuse(*this, r, "is not one of the map", "its layers are " + names_of(types));
    }
    if (!(r.cell_m > 0) || !std::isfinite(r.cell_m)) refuse(*this, r, "has no cell size above 0", "");
    check_cell(*this, r, frame);
    check_size(*this, r, frame, types[*type]);
    if (const Ring* const ring = std::get_if<Ring>(&r.area)) {
      check_ring(*this, r, *ring);
    } else {
      check_polygon(*this, r, std::get<Polygon>(r.area), frame);
    }
  }
  check_overlaps(*this);
}

const Profile& Schedule::at(double t_s) const {
  if (entries.empty()) throw Error(ErrorCode::kInvalidArgument, "a schedule without profiles");
  std::size_t i = 0;
  while (i + 1 < entries.size() && entries[i + 1].from_s <= t_s) ++i;
  return entries[i].profile;
}

}  // namespace apgm
