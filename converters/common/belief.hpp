#pragma once

namespace apgm::converters {

/// Masses of an occupancy cell; m(Omega) is the rest.
struct Masses {
  float occupied = 0;
  float free = 0;
  friend bool operator==(const Masses&, const Masses&) = default;
};

/// The least committed belief with BetP(O) = p (docs/theory.md): p >= 0.5: m(O) = 2p - 1, else m(F) = 1 - 2p.
/// p = 0.5 gives a cell without data. @param p in [0, 1]
Masses masses_from_probability(double p);
/// The same for p = 1 / (1 + e^-l), without loss near l = 0. Infinite log odds give a mass of 1.
Masses masses_from_log_odds(float log_odds);

/// BetP(O) = m(O) + m(Omega) / 2, in [0, 1].
double pignistic(Masses masses);
/// ln(p / (1 - p)) of BetP(O), limited to +-kMaxLogOdds, at which a mass is 1 in float32.
float log_odds(Masses masses);
inline constexpr float kMaxLogOdds = 20.0f;

}  // namespace apgm::converters
