#include "converters/common/belief.hpp"

#include <algorithm>
#include <cmath>

#include "apgm/core/portable_math.hpp"

namespace apgm::converters {
namespace {

/// Masses of the signed belief d = m(O) - m(F) where one of both is 0.
Masses signed_belief(double d) {
  const auto m = static_cast<float>(std::min(std::fabs(d), 1.0));
  return d >= 0 ? Masses{m, 0} : Masses{0, m};
}

}  // namespace

Masses masses_from_probability(double p) { return signed_belief(2 * p - 1); }

Masses masses_from_log_odds(float log_odds) {
  // 2p - 1 = tanh(l / 2); beyond l = 80 it is 1 in double.
  const double l = std::min(std::fabs(static_cast<double>(log_odds)), 80.0);
  const double d = -portable::expm1(-l) / (1 + portable::exp(-l));
  return signed_belief(std::copysign(d, static_cast<double>(log_odds)));
}

double pignistic(Masses masses) {
  return std::clamp(0.5 + (static_cast<double>(masses.occupied) - static_cast<double>(masses.free)) / 2, 0.0,
                    1.0);
}

float log_odds(Masses masses) {
  const double d = static_cast<double>(masses.occupied) - static_cast<double>(masses.free);
  if (std::fabs(d) >= 1) return d > 0 ? kMaxLogOdds : -kMaxLogOdds;
  const double l = portable::log1p(d) - portable::log1p(-d);
  return static_cast<float>(std::clamp<double>(l, -kMaxLogOdds, kMaxLogOdds));
}

}  // namespace apgm::converters
