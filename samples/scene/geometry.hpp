#pragma once

#include <limits>

#include "apgm/core/frame.hpp"

namespace apgm::samples {

inline constexpr double kPi = 3.141592653589793;

/// Adds and scales points as vectors; only + - * / sqrt, so the same bits come out on every machine.
inline Point operator+(Point a, Point b) { return {a.x_m + b.x_m, a.y_m + b.y_m}; }
inline Point operator-(Point a, Point b) { return {a.x_m - b.x_m, a.y_m - b.y_m}; }
inline Point operator*(double s, Point p) { return {s * p.x_m, s * p.y_m}; }
inline double dot(Point a, Point b) { return a.x_m * b.x_m + a.y_m * b.y_m; }
double length(Point p);
/// @param p  not the null vector
Point unit(Point p);
/// The unit vector at `angle_rad` from x towards y.
Point direction(double angle_rad);
/// `local` (x along `axis`, y to its left) in the frame `axis`, a unit vector, is written in.
inline Point turned(Point local, Point axis) {
  return {local.x_m * axis.x_m - local.y_m * axis.y_m, local.x_m * axis.y_m + local.y_m * axis.x_m};
}
/// `axis` turned by a quarter to the left.
inline Point left_of(Point axis) { return {-axis.y_m, axis.x_m}; }

/// A filled oriented rectangle: |x'| <= half.x_m and |y'| <= half.y_m along `axis` and to its left.
struct Rect {
  Point centre;
  Point half;
  Point axis{1, 0};
};
Rect rect_of(const Box& box);

struct Disc {
  Point centre;
  double radius_m = 0;
};

inline constexpr double kNoHit = std::numeric_limits<double>::infinity();

inline bool contains(const Box& box, Point p) {
  return p.x_m >= box.min.x_m && p.x_m < box.max.x_m && p.y_m >= box.min.y_m && p.y_m < box.max.y_m;
}
bool contains(const Rect& rect, Point p);
bool contains(const Disc& disc, Point p);

/// 0 inside.
double distance(const Rect& rect, Point p);

/// The smallest box that holds the shape.
Box bounds(const Rect& rect);
Box bounds(const Disc& disc);

/// Distance along the ray from `origin` in `direction` (a unit vector) to where it enters the shape; 0 from
/// inside, kNoHit if it passes.
double cast(const Rect& rect, Point origin, Point direction);
double cast(const Disc& disc, Point origin, Point direction);

}  // namespace apgm::samples
