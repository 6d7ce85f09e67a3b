#include "converters/fixed_grid/losses.hpp"

#include <algorithm>
#include <bit>

namespace apgm::converters {
namespace {

/// Whether each cell of a layer holds data.
std::vector<bool> known_cells(const Layer& layer, const LayerType& type) {
  std::vector<bool> known(layer.cells());
  for (int c = 0; c < layer.channels(); ++c) {
    const auto none = std::bit_cast<std::uint32_t>(type.background(c));
    for (std::size_t i = 0; i < layer.cells(); ++i) {
      if (std::bit_cast<std::uint32_t>(layer.plane(c)[i]) != none) known[i] = true;
    }
  }
  return known;
}

void count(const Layer& layer, const LayerType& type, const Area& patch, const std::vector<CellBlock>& blocks,
           CellFates& fates) {
  const std::vector<bool> known = known_cells(layer, type);
  const auto side = static_cast<std::size_t>(layer.side());
  const double cell = static_cast<double>(patch.x1_um - patch.x0_um) / static_cast<double>(side);
  std::uint64_t all = 0, inside = 0;
  for (const bool k : known) all += k;
  for (const CellBlock& block : blocks) {
    const Area shared = block.area().shared(patch);
    if (shared.empty()) continue;
    const double fine = static_cast<double>(std::min(block.cell_x_um, block.cell_y_um));
    const double coarse = static_cast<double>(std::max(block.cell_x_um, block.cell_y_um));
    for (std::size_t b = 0; b < side; ++b) {
      const double y = static_cast<double>(patch.y0_um) + cell * (static_cast<double>(b) + 0.5);
      if (y < static_cast<double>(shared.y0_um) || y >= static_cast<double>(shared.y1_um)) continue;
      for (std::size_t a = 0; a < side; ++a) {
        const double x = static_cast<double>(patch.x0_um) + cell * (static_cast<double>(a) + 0.5);
        if (x < static_cast<double>(shared.x0_um) || x >= static_cast<double>(shared.x1_um)) continue;
        if (!known[b * side + a]) continue;
        ++inside;
        fates.merged += coarse > cell;
        fates.split += coarse <= cell && fine < cell;
      }
    }
  }
  fates.known += all;
  fates.outside += all - inside;
}

}  // namespace

std::vector<CellFates> cell_fates(const Layout& layout, const PatchSource& map) {
  std::vector<CellFates> fates(map.header().types.size());
  std::vector<CellBlock> blocks;
  layout.for_each_block([&](const CellBlock& block) { blocks.push_back(block); });
  const auto cursor = map.patches();
  PatchInfo info;
  Layer layer;
  while (cursor->next(info)) {
    for (const LayerInfo& of : info.layers) {
      map.load(of, layer);
      count(layer, map.header().types[of.type], area_of(map.header().frame, info.patch), blocks,
            fates[of.type]);
    }
  }
  return fates;
}

std::vector<std::uint64_t> cells_split(const Layout& layout, const Map& map) {
  const CellSchema& schema = layout.schema();
  const Frame& frame = map.header().frame;
  std::vector<std::uint64_t> split(schema.types().size());
  layout.for_each_block([&](const CellBlock& block) {
    const std::int64_t side_um = std::max(block.cell_x_um, block.cell_y_um);
    for (int b = 0; b < block.rows; ++b) {
      const float* cell = block.cells + b * block.row_stride;
      for (int a = 0; a < block.columns; ++a, cell += schema.values()) {
        if (!schema.is_known(cell)) continue;
        const PatchIndex patch = frame.patch_at(
            {static_cast<double>(block.x_um + a * block.cell_x_um + block.cell_x_um / 2) / 1e6,
             static_cast<double>(block.y_um + b * block.cell_y_um + block.cell_y_um / 2) / 1e6});
        for (std::size_t t = 0; t < split.size(); ++t) {
          const auto type = static_cast<TypeId>(t);
          const Layer* layer = schema.is_known(cell, type) ? map.find(patch, type) : nullptr;
          split[t] += layer != nullptr && side_um << layer->step() > frame.edge_um;
        }
      }
    }
  });
  return split;
}

}  // namespace apgm::converters
