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
/// Guarantees: end points are taken to the nearest nanometre; from there on all is exact integer arithmetic.
/// Visited are the cells that hold a piece of the segment of positive length, and those of its two ends; each
/// once, in order, the cell of the end last, none else. Cells are half-open: a segment along an edge runs in
/// the upper or right cell, one that passes exactly through a corner goes from one cell to the one across.
/// Consecutive cells share a side or a corner. The reverse of a segment visits the same cells in reverse.
/// Same cells on every machine.
///
/// Cost: about a nanosecond a cell, some tens more a patch.
class RayWalker {
 public:
  explicit RayWalker(const Frame& frame);
  /// @param step_of  asked once per patch met, in order; patches without a step are passed over
  /// @param visit    called per patch, in order; `last` is true for the run that holds the end point. The
  ///                 cells of a run are valid during the call
  /// @throws Error{kInvalidArgument} if a point is not finite, {kLimit} if one lies outside all patches, the
  ///         segment is longer than 1000 km along an axis, or a step is not in 0..11
  void walk(Point from, Point to, const StepOf& step_of,
            const std::function<void(const RayRun& run, bool last)>& visit);

 private:
  Frame frame_;
  std::vector<CellIndex> cells_;
};

}  // namespace apgm
