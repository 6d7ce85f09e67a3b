#include "apgm/ops/render.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>

#include "apgm/core/budget.hpp"
#include "apgm/core/error.hpp"
#include "apgm/core/working_memory.hpp"
#include "apgm/fuse/resample.hpp"
#include "colouring.hpp"
#include "pipeline.hpp"

namespace apgm {
namespace {

using ops::Pixel;

constexpr std::array<std::string_view, 6> kColormapNames{"default", "belief",     "evidence",
                                                         "grey",    "categories", "ramp"};

// Pixels may hold up to 2^31 x 2^31 patches, all that the indices allow.
constexpr int kCoarsestStep = -31;
constexpr std::int64_t kMostPixelsPerPatch = 1 << 20;
constexpr double kLongestSide = 65'535;

// The pixels of all space: a patch is `per_patch` pixels wide, or a pixel 2^-step patches. Pixel (0, 0) has
// its lower-left corner at the datum.
struct PixelGrid {
  int step = 0;  // of the cells that pixels show, where no layer is coarser
  int zoom = 1;  // pixels per cell of that step
  std::int64_t per_patch() const { return step < 0 ? 0 : std::int64_t{zoom} << step; }
  int patches_log2() const { return step < 0 ? -step : 0; }
  double pixel_um(const Frame& frame) const {
    return std::ldexp(static_cast<double>(frame.edge_um), -step) / zoom;
  }
  double pixel_m(const Frame& frame) const { return pixel_um(frame) / 1e6; }
};

// Half-open box of pixels of a PixelGrid.
struct Window {
  std::int64_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  std::int64_t width() const { return x1 - x0; }
  std::int64_t height() const { return y1 - y0; }
};

PixelGrid grid_for(double asked_m, const Frame& frame, int finest) {
  if (!std::isfinite(asked_m) || asked_m <= 0) {
    throw Error(ErrorCode::kInvalidArgument, "the size of a pixel is not a positive number of metres");
  }
  PixelGrid grid{finest, 1};
  const double cell_m = grid.pixel_m(frame);
  const double most_m = asked_m * (1 + 1e-9);
  while (grid.step > kCoarsestStep && 2 * grid.pixel_m(frame) <= most_m) --grid.step;
  const double zoom = std::ceil(cell_m / asked_m - 1e-9);
  if (zoom > 1) {
    if (std::ldexp(zoom, finest) > static_cast<double>(kMostPixelsPerPatch)) {
      throw Error(ErrorCode::kLimit, "pixels are too small: a patch would be more than 2^20 of them wide")
          .hint("choose more metres a pixel");
    }
    grid.zoom = static_cast<int>(zoom);
  }
  return grid;
}

// The pixels that meet the area. A millionth of a pixel is forgiven, so that boxes written in decimal that
// mean a pixel's border get no pixel beyond it.
struct Span {
  double first, last;  // pixel borders; last > first
  double length() const { return last - first; }
};
Span span_of(double min_m, double max_m, double datum_m, double pixel_m) {
  const double first = std::floor((min_m - datum_m) / pixel_m + 1e-6);
  return {first, std::max(first + 1, std::ceil((max_m - datum_m) / pixel_m - 1e-6))};
}

struct View {
  PixelGrid grid;
  Window window;
};

View view_of(const Box& area, const Frame& frame, int finest, const RenderOptions& options) {
  PixelGrid grid = options.pixel_m ? grid_for(*options.pixel_m, frame, finest) : PixelGrid{finest, 1};
  const Point datum = frame.datum_m();
  Span x{}, y{};
  const auto measure = [&] {
    x = span_of(area.min.x_m, area.max.x_m, datum.x_m, grid.pixel_m(frame));
    y = span_of(area.min.y_m, area.max.y_m, datum.y_m, grid.pixel_m(frame));
    return std::max(x.length(), y.length());
  };
  double longest = measure();
  while (!options.pixel_m && longest > options.max_side && grid.step > kCoarsestStep) {
    --grid.step;
    longest = measure();
  }
  const double pixels = x.length() * y.length();
  if (!(longest <= kLongestSide) || !(pixels <= static_cast<double>(options.max_pixels))) {
    throw Error(ErrorCode::kLimit,
                "the picture would exceed " + std::to_string(options.max_pixels) + " pixels or 65535 a side")
        .hint("choose more metres a pixel or a smaller area");
  }
  if (std::max({std::abs(x.first), std::abs(x.last), std::abs(y.first), std::abs(y.last)}) > 0x1p52) {
    throw Error(ErrorCode::kLimit, "the area lies too far from the datum of the map");
  }
  const auto whole = [](double v) { return static_cast<std::int64_t>(v); };
  return {grid, {whole(x.first), whole(y.first), whole(x.last), whole(y.last)}};
}

PatchRange patches_of(const View& view) {
  const auto index = [](std::int64_t v) {
    return static_cast<std::int32_t>(std::clamp<std::int64_t>(v, INT32_MIN, INT32_MAX));
  };
  const Window& w = view.window;
  if (const std::int64_t n = view.grid.per_patch(); n > 0) {
    return {{index(floor_div(w.x0, n)), index(floor_div(w.y0, n))},
            {index(floor_div(w.x1 - 1, n)), index(floor_div(w.y1 - 1, n))}};
  }
  const std::int64_t n = std::int64_t{1} << view.grid.patches_log2();
  // A window of more patches than there are indices is clamped before it is multiplied.
  const auto border = [n](std::int64_t v) {
    return std::clamp<std::int64_t>(v, -(1LL << 32), 1LL << 32) * n;
  };
  return {{index(border(w.x0)), index(border(w.y0))}, {index(border(w.x1) - 1), index(border(w.y1) - 1)}};
}

// Merges patches to pixels that hold several, 2 x 2 at a time. Patches come along the Hilbert curve, which
// leaves an aligned square for good before it enters the next: one open square a level is enough.
class Pyramid {
 public:
  /// @param emit  receives finished pixels (x, y) as a layer of one cell
  using Emit = std::function<void(std::int64_t x, std::int64_t y, const Layer&)>;
  Pyramid(const LayerType& type, int depth, Emit emit)
      : type_(type), levels_(static_cast<std::size_t>(depth)), emit_(std::move(emit)) {}

  /// Takes the one cell of a patch, or of a square of patches at a higher level.
  void add(std::int64_t x, std::int64_t y, const Layer& cell, std::size_t level = 0) {
    if (level == levels_.size()) return emit_(x, y, cell);
    Level& l = levels_[level];
    if (l.open && (l.x != x >> 1 || l.y != y >> 1)) close(level);
    if (!l.open) {
      l.quad.reset(type_, 1);
      l.x = x >> 1;
      l.y = y >> 1;
      l.open = true;
    }
    const CellIndex place{static_cast<std::int32_t>(x & 1), static_cast<std::int32_t>(y & 1)};
    for (int c = 0; c < cell.channels(); ++c) l.quad.at(c, place) = cell.plane(c)[0];
  }

  void finish() {
    for (std::size_t level = 0; level < levels_.size(); ++level) {
      if (levels_[level].open) close(level);
    }
  }

 private:
  struct Level {
    bool open = false;
    std::int64_t x = 0, y = 0;
    Layer quad, merged;
  };

  void close(std::size_t level) {
    Level& l = levels_[level];
    resample(l.quad, type_, 0, l.merged);
    l.open = false;
    add(l.x, l.y, l.merged, level + 1);
  }

  const LayerType& type_;
  std::vector<Level> levels_;
  Emit emit_;
};

struct RenderJob final : ops::Job {
  bool has_layer = false;
  LayerInfo info;
  Layer merged;
  std::vector<Pixel> row;
};

class RenderStream final : public ops::Stream {
 public:
  RenderStream(const PatchSource& source, const RenderOptions& options, const View& view,
               const ops::Colouring& colouring, Rendering& out)
      : source_(source),
        type_id_(options.type),
        type_(source.header().types[options.type]),
        view_(view),
        colouring_(colouring),
        out_(out),
        cursor_(source.patches(patches_of(view))),
        pyramid_(type_, view.grid.patches_log2(),
                 [this](std::int64_t x, std::int64_t y, const Layer& cell) { draw_pixel(x, y, cell); }) {}

  std::unique_ptr<ops::Job> make_job() const override { return std::make_unique<RenderJob>(); }

  bool produce(ops::Job& base) override {
    auto& job = static_cast<RenderJob&>(base);
    if (!cursor_->next(patch_)) return false;
    job.patch = patch_.patch;
    job.has_layer = false;
    for (const LayerInfo& info : patch_.layers) {
      if (info.type != type_id_) continue;
      job.has_layer = true;
      job.info = info;
    }
    return true;
  }

  void work(ops::Job& base) const override {
    auto& job = static_cast<RenderJob&>(base);
    if (!job.has_layer) return;
    source_.load(job.info, job.desk.scratch);
    const int step = std::min(job.desk.scratch.step(), std::max(view_.grid.step, 0));
    const Layer* layer = &job.desk.scratch;
    if (step != job.desk.scratch.step()) {
      resample(job.desk.scratch, type_, step, job.merged);
      layer = &job.merged;
    }
    if (view_.grid.step >= 0) {
      draw(job.patch, *layer, job.row);  // patches share no pixel: any thread may write its own
    } else if (layer == &job.desk.scratch) {
      job.merged = job.desk.scratch;
    }
  }

  void consume(ops::Job& base) override {
    auto& job = static_cast<RenderJob&>(base);
    if (!job.has_layer) return;
    ++out_.layers;
    if (view_.grid.step < 0) pyramid_.add(job.patch.x, job.patch.y, job.merged);
    if (out_.patch_px > 0) {
      const std::int64_t n = view_.grid.per_patch();
      out_.patches.push_back({static_cast<int>(job.patch.x * n - view_.window.x0),
                              static_cast<int>(view_.window.y1 - (job.patch.y + std::int64_t{1}) * n)});
    }
  }

  void finish() {
    if (view_.grid.step < 0) pyramid_.finish();
  }

 private:
  void draw_pixel(std::int64_t x, std::int64_t y, const Layer& cell) const {
    const Window& w = view_.window;
    if (x < w.x0 || x >= w.x1 || y < w.y0 || y >= w.y1) return;
    Pixel pixel;
    colouring_.paint(cell, 0, {&pixel, 1});
    std::memcpy(pixel_at(x, y), &pixel, sizeof pixel);
  }

  std::uint8_t* pixel_at(std::int64_t x, std::int64_t y) const {
    const Window& w = view_.window;
    return out_.raster.rgba.data() + ((w.y1 - 1 - y) * w.width() + (x - w.x0)) * sizeof(Pixel);
  }

  // Draws the cells of a patch as squares of pixels, row by row, inside the window only.
  void draw(PatchIndex patch, const Layer& layer, std::vector<Pixel>& row) const {
    const Window& w = view_.window;
    const std::int64_t n = view_.grid.per_patch();
    const std::int64_t side = n >> layer.step();  // of a cell, in pixels
    const std::int64_t left = patch.x * n, bottom = patch.y * n;
    const std::int64_t i0 = std::max<std::int64_t>(0, w.x0 - left), i1 = std::min(n, w.x1 - left);
    const std::int64_t j0 = std::max<std::int64_t>(0, w.y0 - bottom), j1 = std::min(n, w.y1 - bottom);
    if (i0 >= i1 || j0 >= j1) return;
    const std::int64_t a0 = i0 / side, a1 = (i1 - 1) / side + 1;
    row.resize(static_cast<std::size_t>(a1 - a0));
    const std::size_t bytes = static_cast<std::size_t>(i1 - i0) * sizeof(Pixel);
    for (std::int64_t j = j0; j < j1; ++j) {
      std::uint8_t* line = pixel_at(left + i0, bottom + j);
      if (j > j0 && j % side != 0) {
        std::memcpy(line, pixel_at(left + i0, bottom + j - 1), bytes);
        continue;
      }
      colouring_.paint(layer, static_cast<std::size_t>((j / side) * layer.side() + a0), row);
      if (side == 1) {
        std::memcpy(line, row.data(), bytes);
        continue;
      }
      for (std::int64_t i = i0; i < i1; ++i) {
        std::memcpy(line + (i - i0) * sizeof(Pixel), &row[static_cast<std::size_t>(i / side - a0)],
                    sizeof(Pixel));
      }
    }
  }

  const PatchSource& source_;
  TypeId type_id_;
  const LayerType& type_;
  View view_;
  const ops::Colouring& colouring_;
  Rendering& out_;
  std::unique_ptr<PatchCursor> cursor_;
  PatchInfo patch_;
  Pyramid pyramid_;
};

// Finest step a layer of the type has in the map.
std::optional<int> finest_step(const Summary& summary, TypeId type) {
  if (type >= summary.types.size()) return {};
  const auto& at = summary.types[type].layers_at;
  for (int step = kMaxStep; step >= 0; --step) {
    if (at[static_cast<std::size_t>(step)] > 0) return step;
  }
  return {};
}

std::uint64_t raster_bytes(const View& view) {
  return static_cast<std::uint64_t>(view.window.width() * view.window.height()) * sizeof(Pixel);
}

/// What is at work beside the raster: layers, and what decoding takes of them.
ops::StreamSize stream_size(const PatchSource& source, TypeId type, std::uint64_t patches) {
  const std::uint64_t largest[] = {ops::largest_layers(source)[type]};
  return {patches, ops::job_bytes(largest, 1), working_bytes(source, largest[0])};
}

void allocate(const View& view, const ops::Colouring& colouring, Raster& raster) {
  const std::uint64_t bytes = raster_bytes(view);
  raster.width = static_cast<int>(view.window.width());
  raster.height = static_cast<int>(view.window.height());
  raster.rgba.resize(bytes);
  const Pixel nothing = colouring.nothing();
  for (std::size_t i = 0; i < bytes; i += sizeof nothing) {
    std::memcpy(raster.rgba.data() + i, &nothing, sizeof nothing);
  }
}

Box box_of(const View& view, const Frame& frame) {
  const double pixel_um = view.grid.pixel_um(frame);
  // Divided last: corners on whole micrometres are the doubles nearest to them.
  const auto metres = [&](std::int64_t datum_um, std::int64_t pixels) {
    return (static_cast<double>(datum_um) + pixel_um * static_cast<double>(pixels)) / 1e6;
  };
  const auto corner = [&](std::int64_t x, std::int64_t y) {
    return Point{metres(frame.datum_x_um, x), metres(frame.datum_y_um, y)};
  };
  return {corner(view.window.x0, view.window.y0), corner(view.window.x1, view.window.y1)};
}

}  // namespace

std::string_view to_string(Colormap colormap) {
  return kColormapNames.at(static_cast<std::size_t>(colormap));
}

std::optional<Colormap> colormap_from(std::string_view name) {
  const auto it = std::find(kColormapNames.begin(), kColormapNames.end(), name);
  if (it == kColormapNames.end()) return {};
  return static_cast<Colormap>(it - kColormapNames.begin());
}

Rendering render(const PatchSource& source, const RenderOptions& options, const RunOptions& run) {
  const MapHeader& header = source.header();
  if (options.type >= header.types.size()) {
    throw Error(ErrorCode::kInvalidArgument, "the map has no layer type " + std::to_string(options.type));
  }
  if (options.max_side < 1) {
    throw Error(ErrorCode::kInvalidArgument, "the longest side of the picture is not positive");
  }
  ops::Colouring colouring(header.types[options.type], options.colormap, options.channel);
  const Summary summary = source.summary();
  const auto finest = finest_step(summary, options.type);
  if (options.area) (void)header.frame.patches_meeting(*options.area);  // refuses a box that is none

  Rendering out;
  out.legend = colouring.legend();
  if (!finest || summary.range.empty()) return out;
  const Box area = options.area ? *options.area : header.frame.box_m(summary.range);
  const View view = view_of(area, header.frame, *finest, options);
  const ops::StreamSize size = stream_size(source, options.type, summary.patches);
  const std::uint64_t least = raster_bytes(view) + size.job_bytes + size.thread_bytes;
  if (run.max_memory_bytes != 0 && least > run.max_memory_bytes) {
    throw over_budget("the picture takes " + std::to_string(least) + " bytes of memory, the limit is " +
                          std::to_string(run.max_memory_bytes),
                      least, "choose more metres a pixel or a smaller area");
  }
  allocate(view, colouring, out.raster);
  out.area = box_of(view, header.frame);
  out.pixel_m = view.grid.pixel_m(header.frame);
  const std::int64_t patch_px = view.grid.per_patch();
  out.patch_px = patch_px >= std::max(1, options.min_patch_px) ? static_cast<int>(patch_px) : 0;

  RenderStream stream(source, options, view, colouring, out);
  RunOptions rest = run;
  if (run.max_memory_bytes != 0) rest.max_memory_bytes -= out.raster.rgba.size();
  ops::run_stream(stream, size, rest);
  stream.finish();
  colouring.finish(out.raster.rgba);
  out.legend = colouring.legend();
  return out;
}

}  // namespace apgm
