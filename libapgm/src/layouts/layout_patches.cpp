#include "layouts/layout_patches.hpp"

#include <algorithm>
#include <array>
#include <optional>

#include "apgm/core/error.hpp"
#include "apgm/fuse/resample.hpp"
#include "layouts/cell_pool.hpp"

namespace apgm::layouts {
namespace {

using Part = LayoutPatches::Part;

/// Step of the shorter side of the block's cells. @throws Error{kIncompatible}
int step_in(const Frame& frame, const CellBlock& block) {
  const std::int64_t least = std::min(block.cell_x_um, block.cell_y_um);
  const std::int64_t most = std::max(block.cell_x_um, block.cell_y_um);
  const bool is_aligned = (block.x_um - frame.datum_x_um) % least == 0 &&
                          (block.y_um - frame.datum_y_um) % least == 0 &&
                          (block.x_um - frame.datum_x_um) % block.cell_x_um == 0 &&
                          (block.y_um - frame.datum_y_um) % block.cell_y_um == 0;
  for (int step = 0; step <= kMaxStep && is_aligned; ++step) {
    if (least << step == frame.edge_um && frame.edge_um % most == 0) return step;
  }
  throw Error(ErrorCode::kIncompatible, "the cells of the layout do not fall on those of the map")
      .hint("the patch edge is a cell side times a power of two, and the datum a whole number of cells away");
}

/// Makes the layers of one patch.
class PatchBuilder {
 public:
  PatchBuilder(const Layout& layout, const Area& patch, const std::vector<Part>& parts)
      : schema_(layout.schema()), pool_(schema_), patch_(patch), parts_(parts) {}

  /// nullopt: no data of the type in this patch.
  std::optional<Layer> layer(TypeId type) {
    const auto step = finest(type);
    if (!step) return {};
    const LayerType& t = schema_.types()[type];
    Layer out(t, *step);
    for (int s = 0; s <= *step; ++s) {
      if (std::ranges::none_of(parts_, [&](const Part& p) { return p.step == s && p.is_square(); })) continue;
      Layer native(t, s), split;
      visit_cells([&](const Part& p) { return p.step == s && p.is_square(); },
                  [&](const Part& p, int a, int b, const float* cell) {
                    const auto at = static_cast<std::size_t>(row(p, b, s) * native.side() + column(p, a, s));
                    copy(cell, type, native, at);
                  });
      resample(native, t, *step, split);
      visit_cells([&](const Part& p) { return p.step == s && p.is_square(); },
                  [&](const Part& p, int a, int b, const float*) { copy_part(p, a, b, split, out); });
    }
    visit_cells(
        [](const Part& p) { return !p.is_square(); },
        [&](const Part& p, int a, int b, const float* cell) { split_part(p, a, b, cell, type, out); });
    return out;
  }

 private:
  std::optional<int> finest(TypeId type) const {
    std::optional<int> step;
    for (const Part& p : parts_) {
      if (step && p.step <= *step) continue;
      bool has_data = false;
      visit_cells(
          [&](const Part& q) { return &q == &p; },
          [&](const Part&, int, int, const float* cell) { has_data |= schema_.is_known(cell, type); });
      if (has_data) step = p.step;
    }
    return step;
  }

  template <class Wants, class Visit>
  void visit_cells(Wants&& wants, Visit&& visit) const {
    for (const Part& p : parts_) {
      if (!wants(p)) continue;
      for (int b = p.window.b0; b < p.window.b1; ++b) {
        for (int a = p.window.a0; a < p.window.a1; ++a) {
          visit(p, a, b, p.block->cells + position(*p.block, schema_.values(), a, b));
        }
      }
    }
  }

  std::int64_t side_um(int step) const { return (patch_.x1_um - patch_.x0_um) >> step; }
  /// Where a cell of a block begins in a layer of `step`.
  std::int64_t column(const Part& p, int a, int step) const {
    return (p.block->x_um + a * p.block->cell_x_um - patch_.x0_um) / side_um(step);
  }
  std::int64_t row(const Part& p, int b, int step) const {
    return (p.block->y_um + b * p.block->cell_y_um - patch_.y0_um) / side_um(step);
  }

  void copy(const float* cell, TypeId type, Layer& out, std::size_t at) const {
    for (int c = 0; c < out.channels(); ++c) out.plane(c)[at] = cell[schema_.first(type) + c];
  }

  /// visit(cell of `out`) for those under a cell of a block.
  template <class Visit>
  void visit_under(const Part& p, int a, int b, const Layer& out, Visit&& visit) const {
    const std::int64_t side = side_um(out.step());
    const std::int64_t x0 = column(p, a, out.step()), y0 = row(p, b, out.step());
    const std::int64_t x1 = x0 + p.block->cell_x_um / side, y1 = y0 + p.block->cell_y_um / side;
    for (std::int64_t y = y0; y < y1; ++y) {
      for (std::int64_t x = x0; x < x1; ++x) visit(static_cast<std::size_t>(y * out.side() + x));
    }
  }

  void copy_part(const Part& p, int a, int b, const Layer& split, Layer& out) const {
    visit_under(p, a, b, out, [&](std::size_t at) {
      for (int c = 0; c < out.channels(); ++c) out.plane(c)[at] = split.plane(c)[at];
    });
  }

  void split_part(const Part& p, int a, int b, const float* cell, TypeId type, Layer& out) {
    if (!schema_.is_known(cell, type)) return;
    const double side = static_cast<double>(side_um(out.step()));
    pool_.clear();
    pool_.add(
        type, cell + schema_.first(type),
        side * side / (static_cast<double>(p.block->cell_x_um) * static_cast<double>(p.block->cell_y_um)),
        1.0);
    std::array<float, 16> channels{};
    pool_.restore(type, channels.data());
    visit_under(p, a, b, out, [&](std::size_t at) {
      for (int c = 0; c < out.channels(); ++c) out.plane(c)[at] = channels[static_cast<std::size_t>(c)];
    });
  }

  const CellSchema& schema_;
  CellPool pool_;
  Area patch_;
  const std::vector<Part>& parts_;
};

}  // namespace

LayoutPatches::LayoutPatches(const Layout& layout, const Frame& frame) : layout_(layout), frame_(frame) {
  layout.for_each_block([&](const CellBlock& block) { blocks_.push_back(block); });
  for (const CellBlock& block : blocks_) {
    const int step = step_in(frame, block);
    const PatchRange range = patches_in(frame, block.area());
    for (std::int32_t y = range.min.y; y <= range.max.y; ++y) {
      for (std::int32_t x = range.min.x; x <= range.max.x; ++x) {
        const auto window = cells_in(block, area_of(frame, {x, y}));
        parts_[{curve_key({x, y}), {x, y}}].push_back({&block, window, step});
      }
    }
  }
}

std::map<TypeId, Layer> LayoutPatches::layers(PatchIndex patch) const {
  std::map<TypeId, Layer> layers;
  const auto it = parts_.find({curve_key(patch), patch});
  if (it == parts_.end()) return layers;
  PatchBuilder builder(layout_, area_of(frame_, patch), it->second);
  for (std::size_t t = 0; t < layout_.schema().types().size(); ++t) {
    const auto type = static_cast<TypeId>(t);
    if (auto layer = builder.layer(type)) layers.emplace(type, std::move(*layer));
  }
  return layers;
}

std::vector<PatchIndex> LayoutPatches::reached() const {
  std::vector<PatchIndex> all;
  all.reserve(parts_.size());
  for (const auto& [key, parts] : parts_) all.push_back(key.second);
  return all;
}

}  // namespace apgm::layouts

namespace apgm {

Map to_map(const Layout& layout, const Frame& frame) {
  frame.check();
  MapHeader header;
  header.frame = frame;
  header.types = layout.schema().types();
  Map map(std::move(header));
  const layouts::LayoutPatches patches(layout, frame);
  for (const PatchIndex patch : patches.reached()) {
    auto layers = patches.layers(patch);
    if (!layers.empty()) map.patch(patch).layers = std::move(layers);
  }
  return map;
}

}  // namespace apgm
