#pragma once

#include <memory>

#include "apgm/core/source.hpp"

namespace apgm {

/// Where the source's coordinates lie in the target's: p_target = R(yaw) (p_source - pivot) + pivot + shift.
struct RigidMotion {
  Point shift_m{};
  double yaw_rad = 0;
  Point pivot_m{};
};

/// What regrids may keep, and keep already: shared by those that are made with it.
struct RegridBudget {
  std::uint64_t max_bytes = 0;  ///< 0: no bound
  std::uint64_t used_bytes = 0;
};

/// A source seen on another grid: other edge, datum or yaw, by area weights (docs/theory.md, "Arbitrary ratio
/// or offset"): with w_ij = area(i and j) / area(i), lambda_j = sum w_ij lambda_i (so the sum of lambda is
/// conserved), phi_j = area-weighted mean over the target cell. Each target layer is made once, from the
/// native cells.
///
/// A target patch's step for a type is the coarsest whose cells are no larger than the finest source cell
/// there, unless `step` is given. Patches come in key order; memory is bounded by the number of patches, not
/// of cells. Guarantees: same bytes for any ISA and thread count.
///
/// @throws Error{kLimit|kInvalidArgument} if the frame or the motion cannot be used; over_budget() if
/// `budget`
///         does not hold what is known of the patches
std::unique_ptr<PatchSource> regrid(const PatchSource& source, const Frame& target,
                                    const RigidMotion& motion = {}, std::optional<int> step = {},
                                    RegridBudget* budget = nullptr);

}  // namespace apgm
