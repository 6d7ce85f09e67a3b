#include "apgm/core/polygon.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <tuple>

#include "apgm/core/error.hpp"

namespace apgm {
namespace {

using Wide = __int128;

/// Cell centres are odd multiples of edge / 2^(step + 1): whole numbers of this part of a micrometre.
constexpr int kCentreBits = kMaxStep + 1;

std::int32_t clamp_index(std::int64_t i) {
  return static_cast<std::int32_t>(std::clamp<std::int64_t>(i, std::numeric_limits<std::int32_t>::min(),
                                                            std::numeric_limits<std::int32_t>::max()));
}

Wide ceil_div(Wide value, Wide divisor) {
  const Wide q = value / divisor;
  return q + ((value % divisor != 0) && (value > 0));
}

}  // namespace

PolygonArea::PolygonArea(const Polygon& polygon, const Frame& frame) : frame_(frame) {
  for (const auto& ring : polygon.rings) {
    if (ring.size() < 3) {
      throw Error(ErrorCode::kInvalidArgument, "a ring of the polygon has fewer than 3 corners");
    }
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const Point &p = ring[i], &q = ring[(i + 1) % ring.size()];
      Edge e{to_micrometres(p.x_m), to_micrometres(p.y_m), to_micrometres(q.x_m), to_micrometres(q.y_m)};
      if (e.y0 > e.y1 || (e.y0 == e.y1 && e.x0 > e.x1)) e = {e.x1, e.y1, e.x0, e.y0};
      edges_.push_back(e);
    }
  }
  // By upper end: the edges a row of patches can meet start with the first that ends above it.
  std::ranges::sort(edges_, [](const Edge& a, const Edge& b) {
    return std::tie(a.y1, a.y0, a.x0, a.x1) < std::tie(b.y1, b.y0, b.x0, b.x1);
  });
  const auto index = [&](std::int64_t v, std::int64_t datum) {
    return clamp_index(floor_div(v - datum, frame_.edge_um));
  };
  for (const Edge& e : edges_) {
    range_.add(PatchIndex{index(e.x0, frame_.datum_x_um), index(e.y0, frame_.datum_y_um)});
    range_.add(PatchIndex{index(e.x1, frame_.datum_x_um), index(e.y1, frame_.datum_y_um)});
  }
}

std::optional<PolygonArea::Corners> PolygonArea::corners(PatchIndex patch) const {
  if (!range_.contains(patch)) return {};
  const std::int64_t x = frame_.datum_x_um + patch.x * frame_.edge_um;
  const std::int64_t y = frame_.datum_y_um + patch.y * frame_.edge_um;
  return Corners{x, y, x + frame_.edge_um, y + frame_.edge_um};
}

bool PolygonArea::runs_through(const Edge& e, const Corners& c) {
  if (e.y1 <= c.y0 || e.y0 >= c.y1) return false;
  if (std::max(e.x0, e.x1) <= c.x0 || std::min(e.x0, e.x1) >= c.x1) return false;
  // The last axis that can separate a segment from a box: corners strictly on both sides of its line.
  const Wide dx = e.x1 - e.x0, dy = e.y1 - e.y0;
  const auto side = [&](std::int64_t x, std::int64_t y) { return dx * (y - e.y0) - dy * (x - e.x0); };
  const std::array<Wide, 4> s{side(c.x0, c.y0), side(c.x1, c.y0), side(c.x0, c.y1), side(c.x1, c.y1)};
  return std::ranges::any_of(s, [](Wide v) { return v > 0; }) &&
         std::ranges::any_of(s, [](Wide v) { return v < 0; });
}

PolygonArea::Cover PolygonArea::cover(PatchIndex patch) const {
  const auto c = corners(patch);
  if (!c) return Cover::kNone;
  const auto first = std::ranges::upper_bound(edges_, c->y0, {}, &Edge::y1);
  if (std::any_of(first, edges_.end(), [&](const Edge& e) { return runs_through(e, *c); })) {
    return Cover::kPart;
  }
  std::uint8_t inside = 0;
  const std::int64_t y = (c->y0 << kCentreBits) + (frame_.edge_um << (kCentreBits - 1));
  toggle_row(*c, 0, {&inside, 1}, y, edges_);
  return inside != 0 ? Cover::kAll : Cover::kNone;
}

void PolygonArea::toggle_row(const Corners& c, int step, std::span<std::uint8_t> row, std::int64_t y,
                             std::span<const Edge> edges) const {
  std::ranges::fill(row, std::uint8_t{0});
  const std::int64_t half_cell = frame_.edge_um << (kMaxStep - step);
  const std::int64_t first_centre = (c.x0 << kCentreBits) + half_cell;
  for (const Edge& e : edges) {
    const std::int64_t y0 = e.y0 << kCentreBits, y1 = e.y1 << kCentreBits;
    if (y < y0 || y >= y1) continue;
    const Wide crossing = ceil_div(Wide{y - y0} * (e.x1 - e.x0), Wide{e.y1 - e.y0});
    const Wide x = crossing + (Wide{e.x0} << kCentreBits);
    const Wide a = ceil_div(x - first_centre, Wide{2} * half_cell);
    if (a < static_cast<Wide>(row.size())) row[a < 0 ? 0 : static_cast<std::size_t>(a)] ^= 1;
  }
  for (std::size_t a = 1; a < row.size(); ++a) row[a] ^= row[a - 1];
}

void PolygonArea::keep_centres(PatchIndex patch, int step, std::vector<std::uint8_t>& keep) const {
  const std::size_t side = std::size_t{1} << step;
  keep.assign(side * side, 0);
  const auto c = corners(patch);
  if (!c) return;
  std::vector<Edge> near;
  for (auto it = std::ranges::upper_bound(edges_, c->y0, {}, &Edge::y1); it != edges_.end(); ++it) {
    if (it->y0 < c->y1) near.push_back(*it);
  }
  const std::int64_t half_cell = frame_.edge_um << (kMaxStep - step);
  for (std::size_t b = 0; b < side; ++b) {
    const std::int64_t y = (c->y0 << kCentreBits) + (2 * static_cast<std::int64_t>(b) + 1) * half_cell;
    toggle_row(*c, step, std::span(keep).subspan(b * side, side), y, near);
  }
}

}  // namespace apgm
