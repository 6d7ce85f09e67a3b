#include "converters/geotiff/raster_source.hpp"

#include <algorithm>

#include "apgm/core/error.hpp"

namespace apgm::converters {
namespace {

constexpr double kLoadShare = 1.0 / 64;  // of the budget; many threads load at a time

}  // namespace

/// A window of pixels in memory, and the rule that reads them.
class RasterSource::Pixels {
 public:
  explicit Pixels(const RasterPlan& plan)
      : plan_(plan), in_(plan.rule->bands().size()), out_(plan.rule->type().channels.size()) {}

  void read(const Window& window) {
    window_ = window;
    const auto cells = static_cast<std::size_t>(window.width * window.height);
    if (values_.size() < cells * in_.size()) values_.resize(cells * in_.size());
    for (std::size_t i = 0; i < in_.size(); ++i) {
      plan_.raster->read(plan_.rule->bands()[i], window, std::span(values_).subspan(i * cells, cells));
    }
  }

  /// The cell of a pixel of the window; counts what is met. nullptr: unknown.
  const std::vector<float>* cell(std::int64_t x, std::int64_t y, RasterTally& tally) {
    const std::size_t cells = static_cast<std::size_t>(window_.width * window_.height);
    const auto at = static_cast<std::size_t>(y * window_.width + x);
    for (std::size_t i = 0; i < in_.size(); ++i) in_[i] = values_[i * cells + at];
    const PixelRule::Cell cell = plan_.rule->cell(in_, out_, tally);
    if (cell == PixelRule::Cell::kData) return &out_;
    if (cell == PixelRule::Cell::kNothing) return nullptr;
    ++tally.invalid;
    if (plan_.keep_invalid_out) return nullptr;
    throw Error(ErrorCode::kDamaged, "'" + plan_.raster->path() + "' at " +
                                         plan_.raster->place(window_.x + x, window_.y + y) + ": " +
                                         plan_.rule->why(in_))
        .hint("--set invalid=unknown takes such cells as unknown, and counts them")
        .at(plan_.raster->path());
  }

 private:
  const RasterPlan& plan_;
  Window window_;
  std::vector<double> values_;
  std::vector<double> in_;
  std::vector<float> out_;
};

RasterSource::RasterSource(RasterPlan plan) : plan_(std::move(plan)) {
  header_ = plan_.header;
  header_.frame = plan_.fit.native;
  header_.types = TypeTable({plan_.rule->type()});
  scan();
}

void RasterSource::scan() {
  const std::int64_t width = plan_.raster->width(), height = plan_.raster->height();
  PatchMarks marks({plan_.fit.cell_at(0, 0).patch, plan_.fit.cell_at(width - 1, height - 1).patch});
  constexpr double kShare = 1.0 / 8;  // of the budget
  const std::int64_t most_columns = std::min(plan_.raster->columns_at_a_time(2048), width);
  const std::int64_t most_rows =
      plan_.raster->rows_at_a_time(most_columns, plan_.rule->bands().size(), kShare);
  const std::int64_t band = std::max(most_rows, plan_.raster->block_rows());
  Pixels pixels(plan_);
  // From the top, as the file most likely lies. Windows that share blocks follow each other: no block is
  // decoded again and again.
  for (std::int64_t top = 0; top < height; top += band) {
    for (std::int64_t x0 = 0; x0 < width; x0 += most_columns) {
      for (std::int64_t y = top; y < std::min(top + band, height); y += most_rows) {
        const std::int64_t rows = std::min({most_rows, top + band - y, height - y});
        const Window window{x0, height - y - rows, std::min(most_columns, width - x0), rows};
        if (!plan_.raster->is_absent(window)) scan(window, pixels, marks);
      }
    }
  }
  list(marks.marked());
}

void RasterSource::scan(const Window& window, Pixels& pixels, PatchMarks& marks) {
  pixels.read(window);
  for (std::int64_t y = window.height - 1; y >= 0; --y) {
    for (std::int64_t x = 0; x < window.width;) {
      // As far as the row lies in one patch.
      const Frame::Cell at = plan_.fit.cell_at(window.x + x, window.y + y);
      const std::int64_t end = std::min(x + (std::int64_t{1} << plan_.fit.step) - at.cell.a, window.width);
      bool known = false;
      for (; x < end; ++x) known |= pixels.cell(x, y, tally_) != nullptr;
      if (known) marks.mark({at.patch, at.patch});
    }
  }
}

void RasterSource::layers_of(PatchIndex patch, std::vector<LayerInfo>& out) const {
  LayerInfo info;
  info.patch = patch;
  info.step = static_cast<std::uint8_t>(plan_.fit.step);
  const auto stamp = plan_.stamps_ns.find(patch);
  if (stamp != plan_.stamps_ns.end()) info.stamp_ns = stamp->second;
  out.push_back(info);
}

/// The pixels that are read at a time.
std::uint64_t RasterSource::working_bytes(std::uint64_t /*layer_bytes*/) const {
  const std::int64_t side = std::int64_t{1} << plan_.fit.step;
  const std::size_t bands = plan_.rule->bands().size();
  const std::int64_t rows = std::min(plan_.raster->rows_at_a_time(side, bands, kLoadShare), side);
  return static_cast<std::uint64_t>(rows * side) * bands * sizeof(double);
}

void RasterSource::load(const LayerInfo& info, Layer& out) const {
  out.reset(header_.types[info.type], plan_.fit.step);
  out.stamp_ns = info.stamp_ns;
  const std::int64_t side = out.side();
  const std::int64_t x0 = info.patch.x * side - plan_.fit.offset_x;
  const std::int64_t y0 = info.patch.y * side - plan_.fit.offset_y;
  const std::int64_t left = std::max<std::int64_t>(x0, 0), low = std::max<std::int64_t>(y0, 0);
  const Window window{left, low, std::min(x0 + side, plan_.raster->width()) - left,
                      std::min(y0 + side, plan_.raster->height()) - low};
  if (window.width <= 0 || window.height <= 0 || plan_.raster->is_absent(window)) return;
  const std::int64_t most_rows =
      plan_.raster->rows_at_a_time(window.width, plan_.rule->bands().size(), kLoadShare);
  Pixels pixels(plan_);
  RasterTally counted_before;
  for (std::int64_t y = 0; y < window.height; ++y) {
    const std::int64_t row = y % most_rows;
    if (row == 0) pixels.read({left, low + y, window.width, std::min(most_rows, window.height - y)});
    for (std::int64_t x = 0; x < window.width; ++x) {
      const auto* cell = pixels.cell(x, row, counted_before);
      if (cell == nullptr) continue;
      const auto at = static_cast<std::size_t>((low + y - y0) * side + left + x - x0);
      for (std::size_t c = 0; c < cell->size(); ++c) out.plane(static_cast<int>(c))[at] = (*cell)[c];
    }
  }
}

}  // namespace apgm::converters
