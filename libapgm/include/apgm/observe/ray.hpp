#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "apgm/core/frame.hpp"

namespace apgm {

/// Step at which a patch is observed; nullopt: not at all.
using StepOf = std::function<std::optional<int>(PatchIndex)>;

/// The cells of one patch that a segment crosses, in order from its start.
struct RayRun {
  PatchIndex patch;
  int step = 0;
  std::span<const CellIndex> cells;
};

/// Walks segments through patches whose cells differ in size from patch to patch.
///
/// Guarantees: end points are taken to the nearest nanometre; from there on all is exact integer arithmetic:
/// each half-open cell whose area the segment meets is visited once, in order, the cell of the end last, and
/// none else; a segment that passes exactly through a corner visits the two cells it has length in (and the
/// end cells). A segment and its reverse visit the same cells but for those it only touches at a corner or
/// along an edge. Same cells on every machine.
class RayWalker {
 public:
  explicit RayWalker(const Frame& frame);
  /// @param step_of  asked once per patch met; patches without a step are passed over
  /// @param visit    called per patch, in order; `last` is true for the run that holds the end point
  /// @throws Error{kInvalidArgument|kLimit} if a point is not finite or outside all patches
  void walk(Point from, Point to, const StepOf& step_of,
            const std::function<void(const RayRun& run, bool last)>& visit);

 private:
  Frame frame_;
  std::vector<CellIndex> cells_;
};

}  // namespace apgm
