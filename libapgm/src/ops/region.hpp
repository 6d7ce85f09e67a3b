#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "apgm/core/layer.hpp"
#include "apgm/ops/crop.hpp"

namespace apgm::ops {

/// A polygon over the grid of a frame, even-odd over all rings. Vertices are taken to the nearest micrometre;
/// from there on every decision is exact integer arithmetic.
class PolygonArea {
 public:
  /// @throws Error{kInvalidArgument} if a ring has fewer than 3 vertices or one is not finite, {kLimit} if
  ///         beyond 1e9 m
  PolygonArea(const Polygon& polygon, const Frame& frame);

  /// Patches that the bounding box of the polygon meets.
  PatchRange range() const { return range_; }

  enum class Cover : std::uint8_t { kNone, kPart, kAll };
  /// How much of a patch's area the polygon covers; kPart where an edge runs through it.
  Cover cover(PatchIndex patch) const;

  /// Sets keep[b * 2^step + a] to 1 where the centre of cell (a, b) lies inside, else to 0. A centre on an
  /// edge belongs to the area to the upper right of it.
  void keep_centres(PatchIndex patch, int step, std::vector<std::uint8_t>& keep) const;

 private:
  struct Edge {  // y0 < y1, or y0 == y1 and x0 <= x1; micrometres
    std::int64_t x0, y0, x1, y1;
  };
  struct Corners {
    std::int64_t x0, y0, x1, y1;
  };
  std::optional<Corners> corners(PatchIndex patch) const;
  static bool runs_through(const Edge& edge, const Corners& c);
  /// Cells of a row, left of which an edge passes an odd number of times; `y` in units of 2^-12 micrometres.
  void toggle_row(const Corners& c, int step, std::span<std::uint8_t> row, std::int64_t y,
                  std::span<const Edge> edges) const;

  Frame frame_;
  std::vector<Edge> edges_;
  PatchRange range_;
};

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
