#pragma once

#include <cstdint>

#include "apgm/core/layer.hpp"
#include "apgm/fuse/combine.hpp"

namespace apgm::observe {

/// Forgetting by discount (paper, m^alpha), in whole ticks of time: of the powers of two of a second the
/// longest in which at least 0.99 of the evidence is left. So the masses of a layer depend on the ticks that
/// passed, never on how often somebody looked: a layer may be aged in one go or in many.
class Ageing {
 public:
  /// A mass below this shows no longer in m(Omega) as float32, and becomes 0.
  static constexpr float kForgotten = 0x1p-24f;

  /// @param per_s  share of the evidence that is left after a second, in (0, 1]
  explicit Ageing(double per_s);
  bool active() const { return most_ticks_ > 0; }
  /// Number of the tick that holds a time; 0 when nothing is forgotten. A tick is 1/512 s or longer: numbers
  /// of ticks and their differences do not overflow, whatever the times are.
  std::int64_t tick_of(std::int64_t stamp_ns) const { return active() ? floor_div(stamp_ns, tick_ns_) : 0; }
  /// Discounts all cells by the ticks that passed; real channels stay.
  void apply(Layer& layer, const LayerType& type, std::int64_t ticks) const;

 private:
  std::int64_t tick_ns_ = 1;
  float factor_ = 1;    // of a tick
  int most_ticks_ = 0;  // after which nothing is left; 0: nothing is forgotten
};

/// Scales the masses of each cell in `rows` so that m(Omega) is at least `min_unknown`; real channels stay.
/// Cells within 1e-6 of it are left alone: doing it twice changes nothing.
void keep_unknown(Layer& layer, const LayerType& type, RowRange rows, float min_unknown);

}  // namespace apgm::observe
