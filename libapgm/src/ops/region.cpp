#include "region.hpp"

#include <algorithm>

namespace apgm::ops {
namespace {

PatchRange intersection(const PatchRange& a, const PatchRange& b) {
  return {{std::max(a.min.x, b.min.x), std::max(a.min.y, b.min.y)},
          {std::min(a.max.x, b.max.x), std::min(a.max.y, b.max.y)}};
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
  if (box_) {
    const Frame::CellRange in = frame_.cells_meeting(patch, step, *box_);
    for (std::size_t i = 0; i < keep.size(); ++i) {
      const auto a = static_cast<std::int32_t>(i % side), b = static_cast<std::int32_t>(i / side);
      keep[i] &= a >= in.min.a && a <= in.max.a && b >= in.min.b && b <= in.max.b;
    }
  }
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
