#include "region.hpp"

#include <algorithm>
#include <utility>

namespace apgm::ops {
namespace {

PatchRange intersection(const PatchRange& a, const PatchRange& b) {
  return {{std::max(a.min.x, b.min.x), std::max(a.min.y, b.min.y)},
          {std::min(a.max.x, b.max.x), std::min(a.max.y, b.max.y)}};
}

/// Takes the cells outside a range out of a mask.
void drop_outside(const Frame::CellRange& in, std::size_t side, std::vector<std::uint8_t>& keep) {
  if (in.empty()) {
    std::ranges::fill(keep, std::uint8_t{0});
    return;
  }
  const auto from = static_cast<std::size_t>(in.min.a), to = static_cast<std::size_t>(in.max.a) + 1;
  for (std::size_t b = 0; b < side; ++b) {
    const auto row = std::span(keep).subspan(b * side, side);
    const bool inside = std::cmp_greater_equal(b, in.min.b) && std::cmp_less_equal(b, in.max.b);
    std::ranges::fill(inside ? row.first(from) : row, std::uint8_t{0});
    if (inside) std::ranges::fill(row.subspan(to), std::uint8_t{0});
  }
}

}  // namespace

Region::Region(const CropRegion& region, Snap snap, const Frame& frame)
    : frame_(frame), snap_(snap), box_(region.box) {
  const auto narrow = [&](const PatchRange& r) { range_ = range_ ? intersection(*range_, r) : r; };
  if (box_) narrow(frame_.patches_meeting(*box_));
  if (region.polygon) narrow(polygon_.emplace(*region.polygon, frame_).range());
  if (region.like != nullptr) narrow(region.like->summary().range);
}

PolygonArea::Cover Region::cover(PatchIndex patch) const {
  using Cover = PolygonArea::Cover;
  if (range_ && !range_->contains(patch)) return Cover::kNone;
  const Cover polygon = polygon_ ? polygon_->cover(patch) : Cover::kAll;
  if (polygon == Cover::kNone) return Cover::kNone;
  if (snap_ == Snap::kPatch) return Cover::kAll;
  const bool in_box = !box_ || frame_.cells_meeting(patch, kMaxStep, *box_).all(kMaxStep);
  return polygon == Cover::kAll && in_box ? Cover::kAll : Cover::kPart;
}

PolygonArea::Cover Region::mask(PatchIndex patch, int step, std::vector<std::uint8_t>& keep) const {
  using Cover = PolygonArea::Cover;
  const std::size_t side = std::size_t{1} << step;
  if (polygon_) {
    polygon_->keep_centres(patch, step, keep);
  } else {
    keep.assign(side * side, 1);
  }
  if (box_) drop_outside(frame_.cells_meeting(patch, step, *box_), side, keep);
  const auto kept = static_cast<std::size_t>(std::ranges::count(keep, std::uint8_t{1}));
  return kept == 0 ? Cover::kNone : kept == keep.size() ? Cover::kAll : Cover::kPart;
}

void clip(const LayerType& type, std::span<const std::uint8_t> keep, Layer& layer) {
  for (int c = 0; c < layer.channels(); ++c) {
    const auto plane = layer.plane(c);
    const float background = type.background(c);
    for (std::size_t i = 0; i < plane.size(); ++i) plane[i] = keep[i] != 0 ? plane[i] : background;
  }
}

}  // namespace apgm::ops
