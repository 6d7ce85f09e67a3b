#include "scene/furniture.hpp"

#include "scene/random.hpp"

namespace apgm::samples {
namespace {

constexpr double kWall_m = 0.3;

}  // namespace

void add_building(Scene& scene, const Rect& outside) {
  const Point inner = outside.half - Point{kWall_m, kWall_m};
  const Point wall = 0.5 * (outside.half + inner);  // centres of the walls
  for (const double side : {-1.0, 1.0}) {
    scene.add_wall({outside.centre + turned({0, side * wall.y_m}, outside.axis),
                    {outside.half.x_m, kWall_m / 2},
                    outside.axis});
    scene.add_wall({outside.centre + turned({side * wall.x_m, 0}, outside.axis),
                    {kWall_m / 2, outside.half.y_m},
                    outside.axis});
  }
  scene.add_inside({outside.centre, inner, outside.axis});
}

void add_bays(Scene& scene, Point corner, int count, double taken, std::uint64_t seed, const Box& keep_free) {
  Random random(seed);
  for (int k = 0; k <= count; ++k) {
    const double x_m = corner.x_m + kBayWidth_m * k;
    scene.add_paint(
        rect_of({{x_m - kLine_m / 2, corner.y_m}, {x_m + kLine_m / 2, corner.y_m + kBayDepth_m}}));
    if (k == count) break;
    // All draws happen for every bay, so that one bay does not decide how the next one looks.
    const bool has_car = random.uniform() < taken;
    const Point shift{0.15 * random.bell(), 0.2 * random.bell()};
    const double slope = 0.03 * random.bell();
    const double half_length = 2.0 + 0.4 * random.uniform();
    const double half_width = 0.85 + 0.1 * random.uniform();
    const Point centre{x_m + kBayWidth_m / 2, corner.y_m + kBayDepth_m / 2};
    if (!has_car || contains(keep_free, centre)) continue;
    scene.add_car({centre + 0.5 * shift, {half_length, half_width}, unit({slope, 1})});
  }
}

}  // namespace apgm::samples
