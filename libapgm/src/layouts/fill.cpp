#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <optional>
#include <utility>

#include "apgm/core/error.hpp"
#include "apgm/fuse/regrid.hpp"
#include "apgm/fuse/resample.hpp"
#include "layouts/cell_pool.hpp"
#include "layouts/geometry.hpp"

namespace apgm {
namespace {

using layouts::CellPool;

/// Sides of a cell.
struct Shape {
  std::int64_t x_um = 0, y_um = 0;
  std::int64_t least() const { return std::min(x_um, y_um); }
  std::int64_t most() const { return std::max(x_um, y_um); }
  bool is_square() const { return x_um == y_um; }
  friend auto operator<=>(const Shape&, const Shape&) = default;
};

/// log2 of `whole / part`, if that is a power of two up to 2^11.
std::optional<int> steps_between(std::int64_t part, std::int64_t whole) {
  for (int k = 0; k <= kMaxStep; ++k) {
    if (part << k == whole) return k;
  }
  return {};
}

/// A map in cells of one side, whose patches hold whole cells of a shape.
class MapInSquares {
 public:
  MapInSquares(const PatchSource& map, const Frame& layout, Shape shape) : source_(&map) {
    const Frame& own = map.header().frame;
    const auto step = steps_between(shape.least(), own.edge_um);
    const bool is_aligned = (own.datum_x_um - layout.datum_x_um) % shape.most() == 0 &&
                            (own.datum_y_um - layout.datum_y_um) % shape.most() == 0;
    if (step && is_aligned && shape.most() <= own.edge_um) {
      step_ = *step;
      return;
    }
    Frame frame = layout;
    step_ = steps_between(shape.least(), shape.most()).value();
    for (frame.edge_um = shape.most(); frame.edge_um < own.edge_um && step_ < kMostRegridStep; ++step_) {
      frame.edge_um *= 2;
    }
    regridded_ = regrid(map, frame, {}, step_);
    source_ = regridded_.get();
  }

  const PatchSource& source() const { return *source_; }
  Area area(PatchIndex patch) const { return area_of(source_->header().frame, patch); }
  /// The layer in squares of the shape's shorter side. Valid until the next call.
  const Layer& load(const LayerInfo& info) {
    source_->load(info, native_);
    if (native_.step() == step_) return native_;
    resample(native_, source_->header().types[info.type], step_, resampled_);
    return resampled_;
  }

 private:
  static constexpr int kMostRegridStep = 8;

  const PatchSource* source_;
  std::unique_ptr<PatchSource> regridded_;
  int step_ = 0;
  Layer native_;
  Layer resampled_;
};

/// Writes layers of one type into the blocks of one shape.
class LayerWriter {
 public:
  LayerWriter(Layout& layout, Shape shape)
      : layout_(layout), schema_(layout.schema()), shape_(shape), pool_(schema_) {}

  void write(TypeId type, const Layer& layer, const Area& patch) {
    layout_.edit_blocks(patch, [&](const CellBlock& block, float* cells) {
      if (Shape{block.cell_x_um, block.cell_y_um} != shape_) return;
      const auto window = layouts::cells_in(block, patch);
      const std::int64_t side = shape_.least();
      for (int b = window.b0; b < window.b1; ++b) {
        for (int a = window.a0; a < window.a1; ++a) {
          // The first square of the cell in the layer.
          const auto at =
              static_cast<std::size_t>((block.y_um + b * shape_.y_um - patch.y0_um) / side * layer.side() +
                                       (block.x_um + a * shape_.x_um - patch.x0_um) / side);
          if (!make(type, layer, at)) continue;
          std::copy_n(cell_.data(), layer.channels(),
                      cells + layouts::position(block, schema_.values(), a, b) + schema_.first(type));
        }
      }
    });
  }

 private:
  /// The cell whose squares begin at `at`; false if it is without data.
  bool make(TypeId type, const Layer& layer, std::size_t at) {
    if (shape_.is_square()) return take(type, layer, at);
    const auto wide = static_cast<std::size_t>(shape_.x_um / shape_.least());
    const auto high = static_cast<std::size_t>(shape_.y_um / shape_.least());
    const double part = 1.0 / static_cast<double>(wide * high);
    bool has_data = false;
    pool_.clear();
    for (std::size_t b = 0; b < high; ++b) {
      for (std::size_t a = 0; a < wide; ++a) {
        if (!take(type, layer, at + b * static_cast<std::size_t>(layer.side()) + a)) continue;
        has_data = true;
        pool_.add(type, cell_.data(), 1.0, part);
      }
    }
    if (has_data) pool_.restore(type, cell_.data());
    return has_data;
  }

  bool take(TypeId type, const Layer& layer, std::size_t at) {
    // Layers of a source need not be canonical: -0 is 0.
    for (int c = 0; c < layer.channels(); ++c) {
      cell_[static_cast<std::size_t>(c)] = layer.plane(c)[at] + 0.0f;
    }
    const float* background = schema_.background().data() + schema_.first(type);
    return std::memcmp(cell_.data(), background,
                       static_cast<std::size_t>(layer.channels()) * sizeof(float)) != 0;
  }

  Layout& layout_;
  const CellSchema& schema_;
  Shape shape_;
  CellPool pool_;
  std::array<float, 16> cell_{};
};

void fill_shape(Layout& layout, const PatchSource& map, Shape shape, const std::vector<Area>& areas,
                const std::vector<TypeId>& ids) {
  MapInSquares squares(map, layout.frame(), shape);
  LayerWriter writer(layout, shape);
  const auto cursor = squares.source().patches();
  PatchInfo info;
  while (cursor->next(info)) {
    const Area patch = squares.area(info.patch);
    if (std::ranges::none_of(areas, [&](const Area& a) { return a.meets(patch); })) continue;
    for (const LayerInfo& layer : info.layers) writer.write(ids[layer.type], squares.load(layer), patch);
  }
}

}  // namespace

void fill(Layout& layout, const PatchSource& map) {
  const auto ids = matching_ids(map.header().types, layout.schema().types());
  const auto cursor = map.patches();
  PatchInfo info;
  while (cursor->next(info)) {
    if (!info.layers.empty()) layout.reserve(area_of(map.header().frame, info.patch));
  }
  std::map<Shape, std::vector<Area>> shapes;
  layout.for_each_block([&](const CellBlock& block) {
    shapes[{block.cell_x_um, block.cell_y_um}].push_back(block.area());
  });
  for (const auto& [shape, areas] : shapes) fill_shape(layout, map, shape, areas, ids);
}

}  // namespace apgm
