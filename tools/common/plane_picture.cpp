#include "tools/common/plane_picture.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace apgm::tools {

void PlanePicture::put(PatchIndex patch, int step, std::vector<std::uint8_t> cells) {
  Plane plane{step, std::move(cells)};
  while (plane.step > finest_kept_) halve(plane);
  Plane& kept = planes_[patch];
  if (kept.cells.empty()) {
    cells_ += plane.cells.size();
    kept = std::move(plane);
  } else {  // another layer of the same patch
    cells_ -= kept.cells.size();
    while (plane.step > kept.step) halve(plane);
    while (kept.step > plane.step) halve(kept);
    for (std::size_t i = 0; i < plane.cells.size(); ++i) {
      kept.cells[i] = std::max(kept.cells[i], plane.cells[i]);
    }
    cells_ += kept.cells.size();
  }
  keep_within_limit();
}

void PlanePicture::halve(Plane& plane) {
  const std::size_t side = std::size_t{1} << (plane.step - 1);
  std::vector<std::uint8_t> half(side * side);
  for (std::size_t b = 0; b < side; ++b) {
    for (std::size_t a = 0; a < side; ++a) {
      const std::uint8_t* p = plane.cells.data() + 4 * b * side + 2 * a;
      half[b * side + a] = std::max({p[0], p[1], p[2 * side], p[2 * side + 1]});
    }
  }
  plane.cells = std::move(half);
  --plane.step;
}

void PlanePicture::keep_within_limit() {
  while (cells_ > options_.most_cells && finest_kept_ > 0) {
    --finest_kept_;
    cells_ = 0;
    for (auto& [patch, plane] : planes_) {
      while (plane.step > finest_kept_) halve(plane);
      cells_ += plane.cells.size();
    }
  }
}

PlanePicture::View PlanePicture::view() const {
  PatchRange range;
  int finest = 0;
  for (const auto& [patch, plane] : planes_) {
    range.add(patch);
    finest = std::max(finest, plane.step);
  }
  return view_of(range, finest, options_);
}

PlanePicture::View PlanePicture::view_of(const PatchRange& range, int finest,
                                         const PlanePictureOptions& options) {
  View v;
  v.step = finest;
  const auto longest = static_cast<double>(
      1 + std::max(std::int64_t{range.max.x} - range.min.x, std::int64_t{range.max.y} - range.min.y));
  while (v.step > -31 && std::ldexp(longest, v.step) > options.max_side) --v.step;
  while (std::ldexp(longest, v.step + 1) <= options.min_side) ++v.step;
  v.left = View::first(range.min.x, v.step);
  v.bottom = View::first(range.min.y, v.step);
  v.right = View::end(range.max.x, v.step);
  v.top = View::end(range.max.y, v.step);
  return v;
}

std::uint64_t PlanePicture::most_bytes(const PlanePictureOptions& options, const PatchRange& range,
                                       int finest, std::uint64_t cells) {
  if (range.empty()) return 0;
  // Four times as colours: drawn, beside its legend, as PNG libraries want it, packed.
  constexpr std::uint64_t kAPixel = 4 * 4, kText = std::uint64_t{2} << 20;
  const View v = view_of(range, finest, options);
  const std::uint64_t layer = std::uint64_t{1} << (2 * finest);
  // One more plane comes before the limit is kept, and is held once more while it is made smaller.
  return std::min(cells, options.most_cells) + 2 * layer +
         static_cast<std::uint64_t>(v.width() * v.height()) * kAPixel + kText;
}

Rendering PlanePicture::rendering(const Frame& frame, std::span<const Colour> colours, Colour nothing) const {
  Rendering out;
  if (planes_.empty()) return out;
  const View v = view();
  const double pixel_um = std::ldexp(static_cast<double>(frame.edge_um), -v.step);
  const auto metres = [&](std::int64_t datum_um, std::int64_t pixels) {
    return (static_cast<double>(datum_um) + pixel_um * static_cast<double>(pixels)) / 1e6;
  };
  out.pixel_m = pixel_um / 1e6;
  out.area = {{metres(frame.datum_x_um, v.left), metres(frame.datum_y_um, v.bottom)},
              {metres(frame.datum_x_um, v.right), metres(frame.datum_y_um, v.top)}};
  out.layers = planes_.size();

  std::vector<std::uint16_t> canvas(
      static_cast<std::size_t>(v.width() * v.height()));  // byte + 1; 0: nothing
  for (const auto& [patch, plane] : planes_) draw(plane, patch, v, canvas);
  out.raster = {static_cast<int>(v.width()), static_cast<int>(v.height()), {}};
  out.raster.rgba.reserve(canvas.size() * 4);
  for (const std::uint16_t value : canvas) {
    const Colour c = value == 0 ? nothing : colours[value - 1u];
    out.raster.rgba.insert(out.raster.rgba.end(), {c.red, c.green, c.blue, 255});
  }
  list_patches(v, out);
  return out;
}

void PlanePicture::draw(const Plane& plane, PatchIndex patch, const View& view,
                        std::vector<std::uint16_t>& canvas) {
  Plane coarse;
  const Plane* p = &plane;
  if (const int step = std::max(view.step, 0); plane.step > step) {
    coarse = plane;
    while (coarse.step > step) halve(coarse);
    p = &coarse;
  }
  const std::int64_t px = view.step >= 0 ? std::int64_t{1} << (view.step - p->step) : 1;  // of a cell
  const std::int64_t x0 = View::first(patch.x, view.step) - view.left;
  const std::int64_t y0 = View::first(patch.y, view.step);
  const std::int64_t side = px << p->step;
  for (std::int64_t j = 0; j < side; ++j) {
    std::uint16_t* line = canvas.data() + (view.top - 1 - (y0 + j)) * view.width() + x0;
    const std::uint8_t* cells = p->cells.data() + ((j / px) << p->step);
    for (std::int64_t i = 0; i < side; ++i) {
      line[i] = std::max(line[i], static_cast<std::uint16_t>(cells[i / px] + 1));
    }
  }
}

void PlanePicture::list_patches(const View& view, Rendering& out) const {
  const std::int64_t side = view.step >= 0 ? std::int64_t{1} << view.step : 0;
  if (options_.min_patch_px == 0 || side < options_.min_patch_px) return;
  out.patch_px = static_cast<int>(side);
  for (const auto& [patch, plane] : planes_) {
    out.patches.push_back({static_cast<int>(patch.x * side - view.left),
                           static_cast<int>(view.top - (patch.y + std::int64_t{1}) * side)});
  }
}

}  // namespace apgm::tools
