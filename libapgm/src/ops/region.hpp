#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "apgm/core/layer.hpp"
#include "apgm/core/polygon.hpp"
#include "apgm/ops/crop.hpp"

namespace apgm::ops {

/// What a crop keeps: the intersection of the parts of a CropRegion, on the grid of one frame.
class Region {
 public:
  /// @throws as PolygonArea and Frame::patches_meeting
  Region(const CropRegion& region, Snap snap, const Frame& frame);

  /// Patches outside are not kept; nullopt: no bound.
  const std::optional<PatchRange>& range() const { return range_; }
  /// kNone: drop the patch; kAll: keep all of it; kPart: ask `mask` for each layer.
  PolygonArea::Cover cover(PatchIndex patch) const;
  /// Sets keep[b * 2^step + a] to 1 for the cells to keep, else to 0.
  /// @return how many of the layer's cells are kept
  PolygonArea::Cover mask(PatchIndex patch, int step, std::vector<std::uint8_t>& keep) const;

 private:
  Frame frame_;
  Snap snap_;
  std::optional<Box> box_;
  std::optional<PolygonArea> polygon_;
  std::optional<PatchRange> range_;
};

/// Sets the cells that a mask does not keep to the background of `type`.
void clip(const LayerType& type, std::span<const std::uint8_t> keep, Layer& layer);

}  // namespace apgm::ops
