#include "converters/fixed_grid/raster.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "apgm/core/error.hpp"

namespace apgm::converters {
namespace {

constexpr int kRectangleStep = 7;

std::int64_t um(double metres) { return std::llrint(metres * 1e6); }

}  // namespace

LayoutRaster::LayoutRaster(const LayoutDescription& layout) : frame_(layout.frame) {
  if (!layout.moves()) {
    step_ = 0;
    while (um(layout.cell_m) << step_ < frame_.edge_um) ++step_;
    return;
  }
  step_ = kRectangleStep;
  std::int64_t row = 0;
  for (const LayoutRectangle& r : layout.rectangles) {
    const std::int64_t x = frame_.datum_x_um + layout.vehicle_x_um;
    const std::int64_t y = frame_.datum_y_um + layout.vehicle_y_um;
    rectangles_.push_back({x + um(r.x0_m), y + um(r.y0_m), x + um(r.x1_m), y + um(r.y1_m), row});
    const std::int64_t rows = (um(r.y1_m) - um(r.y0_m)) / um(r.dy_m);
    row += ((rows - 1) >> step_ << step_) + (1 << step_);
  }
}

MapHeader LayoutRaster::header(const TypeTable& types) const {
  MapHeader header;
  header.frame = {};
  header.types = types;
  return header;
}

void LayoutRaster::visit_parts(const CellBlock& block, const std::function<void(const Part&)>& visit) const {
  std::int64_t column = 0, row = 0;  // of the raster
  if (rectangles_.empty()) {
    column = floor_div(block.x_um - frame_.datum_x_um, frame_.edge_um) << step_;
    row = floor_div(block.y_um - frame_.datum_y_um, frame_.edge_um) << step_;
  } else {
    const auto at = std::ranges::find_if(rectangles_, [&](const Placed& r) {
      return block.x_um >= r.x_um && block.x_um < r.x1_um && block.y_um >= r.y_um && block.y_um < r.y1_um;
    });
    column = (block.x_um - at->x_um) / block.cell_x_um;
    row = at->first_row + (block.y_um - at->y_um) / block.cell_y_um;
  }
  const std::int64_t side = std::int64_t{1} << step_;
  for (std::int64_t y = row; y < row + block.rows;) {
    const std::int64_t next_y = std::min<std::int64_t>((floor_div(y, side) + 1) * side, row + block.rows);
    for (std::int64_t x = column; x < column + block.columns;) {
      const std::int64_t next_x =
          std::min<std::int64_t>((floor_div(x, side) + 1) * side, column + block.columns);
      const PatchIndex patch{static_cast<std::int32_t>(floor_div(x, side)),
                             static_cast<std::int32_t>(floor_div(y, side))};
      visit({patch, static_cast<int>(x - patch.x * side), static_cast<int>(y - patch.y * side),
             static_cast<int>(x - column), static_cast<int>(y - row), static_cast<int>(next_x - x),
             static_cast<int>(next_y - y)});
      x = next_x;
    }
    y = next_y;
  }
}

Map LayoutRaster::from_layout(const Layout& layout) const {
  const CellSchema& schema = layout.schema();
  Map map(header(schema.types()));
  layout.for_each_block([&](const CellBlock& block) {
    visit_parts(block, [&](const Part& part) {
      for (std::size_t t = 0; t < schema.types().size(); ++t) {
        const auto type = static_cast<TypeId>(t);
        Layer& layer = map.layer(part.patch, type, step_);
        for (int b = 0; b < part.rows; ++b) {
          const float* cell = block.cells + (part.block_b + b) * block.row_stride +
                              std::int64_t{part.block_a} * schema.values() + schema.first(type);
          for (int a = 0; a < part.columns; ++a, cell += schema.values()) {
            for (int c = 0; c < layer.channels(); ++c) layer.at(c, {part.a + a, part.b + b}) = cell[c];
          }
        }
      }
    });
  });
  map.prune();
  return map;
}

void LayoutRaster::to_layout(const Map& map, Layout& layout) const {
  const CellSchema& schema = layout.schema();
  std::vector<Area> areas;
  std::set<PatchIndex> seen;
  layout.for_each_block([&](const CellBlock& block) { areas.push_back(block.area()); });
  for (const auto& [key, patch] : map.by_key()) {
    for (const auto& [type, layer] : patch.layers) {
      if (layer.step() != step_) throw Error(ErrorCode::kDamaged, "cells of another step than the layout's");
    }
  }
  const auto write = [&](const CellBlock& block, float* cells) {
    visit_parts(block, [&](const Part& part) {
      seen.insert(part.patch);
      const Patch* patch = map.find(part.patch);
      if (patch == nullptr) return;
      for (const auto& [type, layer] : patch->layers) {
        for (int b = 0; b < part.rows; ++b) {
          float* cell = cells + (part.block_b + b) * block.row_stride +
                        std::int64_t{part.block_a} * schema.values() + schema.first(type);
          for (int a = 0; a < part.columns; ++a, cell += schema.values()) {
            for (int c = 0; c < layer.channels(); ++c) cell[c] = layer.at(c, {part.a + a, part.b + b});
          }
        }
      }
    });
  };
  Area all = areas.empty() ? Area{} : areas.front();
  for (const Area& a : areas) {
    all = {std::min(all.x0_um, a.x0_um), std::min(all.y0_um, a.y0_um), std::max(all.x1_um, a.x1_um),
           std::max(all.y1_um, a.y1_um)};
  }
  layout.edit_blocks(all, write);
  for (const auto& [key, patch] : map.by_key()) {
    if (!seen.contains(patch.index)) throw Error(ErrorCode::kDamaged, "cells outside the layout");
  }
}

}  // namespace apgm::converters
