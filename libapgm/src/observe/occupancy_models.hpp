#pragma once

#include <vector>

#include "apgm/observe/model.hpp"
#include "observe/grid_point.hpp"

namespace apgm::observe {

/// Greatest mass that one measurement gives to a hypothesis: 1 - 2^-24, the greatest float32 below 1. However
/// many beams agree, none of them was certain, and a mass of 1 could never be revised.
inline constexpr float kMostMass = 0x1.fffffep-1f;

/// Position of `p`, in metres from the lower-left corner of `patch`.
Point within_patch(const GridPoint& p, PatchIndex patch, const Frame& frame);

/// m(O) of one return at `at` (metres from the patch's corner) in cell `cell`: the relevance rho of
/// theory.md.
double nuss_relevance(const NussModel& model, Point at, CellIndex cell, double cell_m);

/// What beams leave in the planes of a layer until it is finished: m(O) in the first, in the second a mark.
inline constexpr float kCrossed = 1, kHit = -1;

/// Turns the marks of the touched rows into m(F).
/// @param origin  of the sensor, metres from the patch's corner
void finish_nuss(const NussModel& model, Point origin, double cell_m, ObservedLayer& layer);

/// Turns counts into masses: R in the first plane, T in the second.
class RichterFinish {
 public:
  explicit RichterFinish(const RichterModel& model);
  void operator()(ObservedLayer& layer) const;

 private:
  struct Masses {
    float occupied, free;
  };
  Masses masses(float returns, float passages) const;
  std::vector<double> fn_, fp_;  // powers of p_fn and p_fp
};

/// Turns counts of pixels per class into masses.
void finish_camera(const CameraModel& model, ObservedLayer& layer);

}  // namespace apgm::observe
