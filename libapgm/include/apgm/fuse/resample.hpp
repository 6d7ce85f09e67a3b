#pragma once

#include "apgm/core/layer.hpp"

namespace apgm {

/// R(l, r) of the paper: brings `in` to `step` by the policy of `type`, merging or splitting by powers of two
/// (docs/theory.md, "Resampling"). The same step copies.
///
/// Guarantees: 2x2 then 2x2 gives the bits of 4x4 in theory and agrees to float32 rounding (kMedian,
/// kDempster and real means over cells without data excepted); no occupied cell vanishes: merged m(O) >= the
/// greatest m(O) (kDempster and kMean excepted); same bytes for any ISA. Only + - * / sqrt are used for
/// occupancy.
///
/// @param out  receives the result, keeps the stamp of `in`; not `in` itself
/// @throws Error{kLimit} if `step` is outside 0..11
void resample(const Layer& in, const LayerType& type, int step, Layer& out);

}  // namespace apgm
