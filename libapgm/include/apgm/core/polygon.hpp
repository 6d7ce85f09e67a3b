#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "apgm/core/frame.hpp"

namespace apgm {

/// An area as polygons with holes, in metres of the map's CRS; even-odd rule over all rings.
struct Polygon {
  std::vector<std::vector<Point>> rings;
  friend bool operator==(const Polygon&, const Polygon&) = default;
};

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

}  // namespace apgm
