#pragma once

#include <cstdint>

#include "scene/scene.hpp"

namespace apgm::samples {

inline constexpr double kLine_m = 0.2;      ///< width of a painted line
inline constexpr double kBayWidth_m = 2.5;  ///< of a parking bay
inline constexpr double kBayDepth_m = 5.0;

/// Four walls with their outer faces on the border of `outside`; nothing is seen inside.
void add_building(Scene& scene, const Rect& outside);

/// A row of `count` bays along x, its lower-left corner at `corner`.
/// @param taken      share of bays that hold a car
/// @param keep_free  bays with their centre in here hold none
void add_bays(Scene& scene, Point corner, int count, double taken, std::uint64_t seed,
              const Box& keep_free = {});

}  // namespace apgm::samples
