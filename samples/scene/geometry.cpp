#include "scene/geometry.hpp"

#include <algorithm>
#include <cmath>

#include "apgm/core/portable_math.hpp"

namespace apgm::samples {
namespace {

/// Clips the ray's interval [near, far] to the slab |origin + t direction| <= half. False if nothing is left.
bool clip(double origin, double direction, double half, double& near, double& far) {
  if (direction == 0) return origin >= -half && origin <= half;
  const double t0 = (-half - origin) / direction;
  const double t1 = (half - origin) / direction;
  near = std::max(near, std::min(t0, t1));
  far = std::min(far, std::max(t0, t1));
  return near <= far;
}

/// `p` along the axis of `rect` and to its left, from its centre.
Point local(const Rect& rect, Point p) {
  return {dot(p, rect.axis), rect.axis.x_m * p.y_m - rect.axis.y_m * p.x_m};
}

}  // namespace

double length(Point p) { return std::sqrt(dot(p, p)); }

Point unit(Point p) { return (1.0 / length(p)) * p; }

Point direction(double angle_rad) { return {portable::cos(angle_rad), portable::sin(angle_rad)}; }

Rect rect_of(const Box& box) { return {0.5 * (box.min + box.max), 0.5 * (box.max - box.min), {1, 0}}; }

bool contains(const Rect& rect, Point p) {
  const Point l = local(rect, p - rect.centre);
  return l.x_m >= -rect.half.x_m && l.x_m <= rect.half.x_m && l.y_m >= -rect.half.y_m &&
         l.y_m <= rect.half.y_m;
}

bool contains(const Disc& disc, Point p) {
  const Point l = p - disc.centre;
  return dot(l, l) <= disc.radius_m * disc.radius_m;
}

double distance(const Rect& rect, Point p) {
  const Point l = local(rect, p - rect.centre);
  return length(
      {std::max(0.0, std::abs(l.x_m) - rect.half.x_m), std::max(0.0, std::abs(l.y_m) - rect.half.y_m)});
}

Box bounds(const Rect& rect) {
  const Point reach{std::abs(rect.axis.x_m) * rect.half.x_m + std::abs(rect.axis.y_m) * rect.half.y_m,
                    std::abs(rect.axis.y_m) * rect.half.x_m + std::abs(rect.axis.x_m) * rect.half.y_m};
  return {rect.centre - reach, rect.centre + reach};
}

Box bounds(const Disc& disc) {
  const Point reach{disc.radius_m, disc.radius_m};
  return {disc.centre - reach, disc.centre + reach};
}

double cast(const Rect& rect, Point origin, Point direction) {
  const Point o = local(rect, origin - rect.centre);
  const Point d = local(rect, direction);
  double near = 0;
  double far = kNoHit;
  if (!clip(o.x_m, d.x_m, rect.half.x_m, near, far)) return kNoHit;
  return clip(o.y_m, d.y_m, rect.half.y_m, near, far) ? near : kNoHit;
}

double cast(const Disc& disc, Point origin, Point direction) {
  const Point to_centre = disc.centre - origin;
  const double outside = dot(to_centre, to_centre) - disc.radius_m * disc.radius_m;
  if (outside <= 0) return 0;
  const double along = dot(to_centre, direction);
  const double root = along * along - outside;
  return along > 0 && root >= 0 ? along - std::sqrt(root) : kNoHit;
}

}  // namespace apgm::samples
