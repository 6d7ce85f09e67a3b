#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "apgm/core/portable_math.hpp"

/// The bijection between masses of singletons with m(Omega) and evidence (docs/theory.md, "Evidence"):
/// Lambda = -ln m(Omega), lambda_k = m_k Lambda / (1 - m(Omega)).
namespace apgm::fuse {

/// Lambda of the least positive float32. m(Omega) = 0 would be infinite, and its shares undefined in sums: it
/// is taken as this.
inline constexpr double kMostEvidence = 103.27892990343184;

/// Lambda from the sum of the masses, or m(Omega), whichever is the more exact.
inline double evidence(double sum, double omega) {
  if (sum <= 0.5) return -portable::log1p(-sum);
  if (!(omega > 0)) return kMostEvidence;
  return std::min(-portable::log(omega), kMostEvidence);
}

/// Masses of `count` hypotheses back from their lambdas; the last float is m(Omega).
inline void masses_from_evidence(const double* lambda, std::size_t count, float* masses, float& omega) {
  double total = 0;
  for (std::size_t k = 0; k < count; ++k) total += lambda[k];
  const double scale = total > 0 ? -portable::expm1(-total) / total : 0.0;
  for (std::size_t k = 0; k < count; ++k) masses[k] = static_cast<float>(lambda[k] * scale);
  // e^-Lambda below float32's range stands for m(Omega) = 0, as it came in.
  omega = total >= kMostEvidence ? 0.0f : static_cast<float>(portable::exp(-total));
}

}  // namespace apgm::fuse
