#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "apgm/ops/diff.hpp"
#include "tools/common/plane_picture.hpp"

namespace apgm::tools {

/// Known in both maps and on the same side, yet with at least this conflict K: drawn as a contradiction.
inline constexpr float kDrawnConflict = 0.25f;

/// Draws both maps of a diff as one: what they share in pale greys, what changed in colours that people with
/// red-green blindness tell apart (after the palette of Okabe and Ito): blue where something became free or
/// known, orange and yellow where it became occupied or unknown, black where both contradict. Where pixels
/// hold several cells the rarer news wins, so that no change vanishes.
class DiffPicture final : public DiffSink {
 public:
  /// @param type  of the cells
  explicit DiffPicture(const LayerType& type);

  /// Most memory it and its picture take.
  /// @param type  that is drawn, by name
  static std::uint64_t most_bytes(const PatchSource& reference, const PatchSource& other,
                                  const std::string& type);

  void put(PatchIndex patch, int step, std::span<const CellDiff> cells) override;
  /// What was collected, with the legend; an empty raster if nothing was.
  Rendering rendering(const Frame& frame) const;

 private:
  /// What a cell is drawn as; of several the last.
  enum Look : std::uint8_t {
    kUnknown,
    kFree,  ///< in both
    kUndecided,
    kOccupied,
    kForgottenFree,
    kForgotten,
    kLearnedFree,
    kLearned,
    kConflict,
    kBecameFree,
    kBecameOccupied,
    kChanged,
    kLooks
  };
  Look look_of(const CellDiff& cell) const;
  Look change_of(const CellDiff& cell) const;
  static Colour colour_of(Look look);

  bool occupancy_, evidence_;
  PlanePicture picture_;
};

}  // namespace apgm::tools
