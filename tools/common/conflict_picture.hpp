#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <span>
#include <vector>

#include "apgm/core/frame.hpp"
#include "apgm/ops/merge.hpp"
#include "apgm/ops/render.hpp"

namespace apgm::tools {

inline constexpr Colour kNothingFused{132, 148, 168};

/// Collects where and how much the inputs of a merge contradict each other, as a grey picture: white for
/// K = 0, black for K = 1, blue-grey for patches with nothing to fuse. Where several layer types were fused,
/// the greatest K of them shows.
///
/// Keeps one byte a fused cell. Beyond `most_cells` cells are merged 2 x 2 to their greatest K, and so are
/// pixels that hold several cells: no conflict vanishes.
class ConflictPicture final : public ConflictSink {
 public:
  explicit ConflictPicture(std::uint64_t most_cells = std::uint64_t{1} << 26, int max_side = 2048)
      : most_cells_(most_cells), max_side_(max_side) {}

  void put(PatchIndex patch, TypeId type, int step, std::span<const float> conflict) override;
  /// What was collected; an empty raster if nothing was.
  Rendering rendering(const Frame& frame) const;

 private:
  struct Plane {
    int step = 0;
    std::vector<std::uint8_t> cells;  // 255 K, as a layer's plane
  };
  // Pixels of all space: a patch is 2^step of them wide, or a pixel 2^-step patches.
  struct View {
    int step = 0;
    std::int64_t left = 0, bottom = 0, right = 0, top = 0;
    static std::int64_t first(std::int64_t index, int step) {
      return step >= 0 ? index << step : index >> -step;
    }
    static std::int64_t end(std::int64_t index, int step) {
      return step >= 0 ? (index + 1) << step : (index >> -step) + 1;
    }
  };
  static void halve(Plane& plane);
  void keep_within_limit();
  View view() const;
  static void draw(const Plane& plane, PatchIndex patch, const View& view, Raster& raster);

  std::uint64_t most_cells_;
  int max_side_;
  int finest_kept_ = kMaxStep;
  std::uint64_t cells_ = 0;
  std::map<PatchIndex, Plane> planes_;
};

inline void ConflictPicture::put(PatchIndex patch, TypeId /*type*/, int step,
                                 std::span<const float> conflict) {
  Plane plane{step, std::vector<std::uint8_t>(conflict.size())};
  for (std::size_t i = 0; i < conflict.size(); ++i) {
    // Rounded up: the least conflict is not shown as none.
    plane.cells[i] =
        static_cast<std::uint8_t>(std::ceil(std::min(1.0f, std::max(0.0f, conflict[i])) * 255.0f));
  }
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

inline void ConflictPicture::halve(Plane& plane) {
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

inline void ConflictPicture::keep_within_limit() {
  while (cells_ > most_cells_ && finest_kept_ > 0) {
    --finest_kept_;
    cells_ = 0;
    for (auto& [patch, plane] : planes_) {
      while (plane.step > finest_kept_) halve(plane);
      cells_ += plane.cells.size();
    }
  }
}

inline ConflictPicture::View ConflictPicture::view() const {
  PatchRange range;
  View v;
  for (const auto& [patch, plane] : planes_) {
    range.add(patch);
    v.step = std::max(v.step, plane.step);
  }
  const std::int64_t longest =
      1 + std::max(std::int64_t{range.max.x} - range.min.x, std::int64_t{range.max.y} - range.min.y);
  while (v.step > -31 && std::ldexp(static_cast<double>(longest), v.step) > max_side_) --v.step;
  v.left = View::first(range.min.x, v.step);
  v.bottom = View::first(range.min.y, v.step);
  v.right = View::end(range.max.x, v.step);
  v.top = View::end(range.max.y, v.step);
  return v;
}

inline Rendering ConflictPicture::rendering(const Frame& frame) const {
  Rendering out;
  for (const int tenths : {0, 5, 10}) {
    const auto shade = static_cast<std::uint8_t>(255 - 255 * tenths / 10);
    out.legend.scale.push_back({fmt::format("K = {:g}", tenths / 10.0), {shade, shade, shade}});
  }
  out.legend.entries = {{"nothing to fuse", kNothingFused}};
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
  out.raster = {static_cast<int>(v.right - v.left), static_cast<int>(v.top - v.bottom), {}};
  out.raster.rgba.resize(static_cast<std::size_t>(out.raster.width) * out.raster.height * 4);
  for (std::size_t i = 0; i < out.raster.rgba.size(); i += 4) {
    const std::array<std::uint8_t, 4> pixel{kNothingFused.red, kNothingFused.green, kNothingFused.blue, 255};
    std::memcpy(out.raster.rgba.data() + i, pixel.data(), pixel.size());
  }
  for (const auto& [patch, plane] : planes_) draw(plane, patch, v, out.raster);
  return out;
}

inline void ConflictPicture::draw(const Plane& plane, PatchIndex patch, const View& view, Raster& raster) {
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
    std::uint8_t* line = raster.rgba.data() + ((view.top - 1 - (y0 + j)) * raster.width + x0) * 4;
    for (std::int64_t i = 0; i < side; ++i) {
      const auto cell = static_cast<std::size_t>(((j / px) << p->step) + i / px);
      const auto shade = static_cast<std::uint8_t>(255 - p->cells[cell]);
      std::uint8_t* at = line + i * 4;
      // A pixel over several patches keeps the darkest. The colour of no patch is no grey.
      if (at[0] != at[2] || shade < at[0]) at[0] = at[1] = at[2] = shade;
    }
  }
}

}  // namespace apgm::tools
