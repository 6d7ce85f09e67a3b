#pragma once

#include <cstddef>

#include "fuse/simd.hpp"

/// Arithmetic on one cell, shared by all kernels, so that each gives the same bits.
namespace apgm::fuse {

/// Masses over {O, F} with m(Omega) at hand.
struct Occupancy {
  float o = 0;
  float f = 0;
  float u = 1;
};

/// 1 - sum of masses that were added one by one to `sum` with the rounding errors in `lost`; not below 0.
struct RunningSum {
  float sum = 0;
  float lost = 0;
  APGM_INLINE void add(float m) {
    // Two-sum (Knuth): sum + lost stays what was added, for any order of magnitudes.
    const float s = sum + m;
    const float part = s - sum;
    lost += (sum - (s - part)) + (m - part);
    sum = s;
  }
  APGM_INLINE float rest() const {
    const float u = (1.0f - sum) - lost;
    return u > 0.0f ? u : 0.0f;
  }
};

APGM_INLINE Occupancy occupancy(float o, float f) {
  // Fast two-sum (Dekker), which needs the greater first: the bits of RunningSum in fewer operations.
  const float hi = o > f ? o : f, lo = o > f ? f : o;
  const float sum = hi + lo;
  return {o, f, RunningSum{sum, lo - (sum - hi)}.rest()};
}

/// Products of two masses may underflow where all that is left after the conflict is small; scaled by this
/// power of two they do not, and no bit of a quotient changes.
inline constexpr float kProductScale = 0x1p100f;

/// Unnormalised masses of Dempster's rule, times kProductScale. `sum` is theirs: 0 if and only if K = 1.
struct Conjunction {
  float o = 0;
  float f = 0;
  float u = 0;
  float sum = 0;
};

/// `a` times kProductScale. Symmetric to the last bit.
APGM_INLINE Conjunction conjoin_scaled(const Occupancy& a, const Occupancy& b) {
  const float o = a.o * b.o + (a.o * b.u + a.u * b.o);
  const float f = a.f * b.f + (a.f * b.u + a.u * b.f);
  const float u = a.u * b.u;
  return {o, f, u, (o + f) + u};
}
APGM_INLINE Conjunction conjoin(const Occupancy& a, const Occupancy& b) {
  return conjoin_scaled({a.o * kProductScale, a.f * kProductScale, a.u * kProductScale}, b);
}

/// Dempster's rule (paper, Sec. III-A), divided by the sum of the unnormalised masses in place of 1 - K:
/// 1 - K loses up to 5.6e-5 at high conflict in float32, the sum 2e-7. K = 1 gives (0, 0, 0). Not yet
/// bounded.
APGM_INLINE Occupancy dempster(const Conjunction& c) {
  const float divisor = c.sum == 0.0f ? 1.0f : c.sum;
  return {c.o / divisor, c.f / divisor, c.u / divisor};
}

/// Both quotients are rounded: their sum may exceed 1 by one unit. Bounded after the last fold only: between
/// folds a small m(F) beside m(O) = 1 would be lost, which a later conflict may make great.
APGM_INLINE Occupancy bounded(const Occupancy& m) {
  const float most = 1.0f - m.o;
  return {m.o, m.f < most ? m.f : most, m.u};
}

/// The same, but a vacuous BBA leaves the bits of the other.
APGM_INLINE Occupancy dempster_data(const Occupancy& a, const Occupancy& b) {
  if (a.o == 0.0f && a.f == 0.0f && a.u > 0.0f) return b;
  if (b.o == 0.0f && b.f == 0.0f) return a;
  return dempster(conjoin(a, b));
}

/// K of two BBAs.
APGM_INLINE float conflict(const Occupancy& a, const Occupancy& b) {
  const float k = a.o * b.f + a.f * b.o;
  return k < 1.0f ? k : 1.0f;
}

}  // namespace apgm::fuse
