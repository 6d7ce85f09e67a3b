#include "converters/map_server/picture_source.hpp"

#include <algorithm>

#include "converters/common/file.hpp"

namespace apgm::converters {

CellRaster read_cells(const std::string& path, const CellRule& rule, std::uint64_t max_memory_bytes) {
  CellRaster cells;
  bool has_alpha = false;
  PictureSink sink;
  sink.begin = [&](const PictureInfo& info, std::uint64_t file_bytes) {
    const auto pixels = static_cast<std::uint64_t>(info.width) * static_cast<std::uint64_t>(info.height);
    check_budget(max_memory_bytes, file_bytes + pixels + info.decoding_bytes,
                 "a picture is held in memory as a whole", "cut it into smaller maps");
    if (max_memory_bytes != 0) cells.values.reserve(pixels);
    cells.width = info.width;
    cells.height = info.height;
    has_alpha = info.has_alpha;
  };
  sink.row = [&](std::span<const Pixel> row) {
    for (const Pixel& pixel : row) cells.values.push_back(rule.value_of(pixel, has_alpha));
  };
  read_picture(path, sink, max_memory_bytes);
  return cells;
}

PictureSource::PictureSource(CellRaster cells, const BeliefTable& beliefs, const GridFit& fit,
                             std::map<std::string, std::string> metadata, std::uint64_t max_memory_bytes)
    : cells_(std::move(cells)), beliefs_(beliefs), fit_(fit) {
  header_.frame = fit.native;
  header_.types = TypeTable({LayerType::occupancy()});
  header_.metadata = std::move(metadata);
  PatchMarks marks({fit_.cell_at(0, 0).patch, fit_.cell_at(cells_.width - 1, cells_.height - 1).patch});
  for (std::int64_t y = 0; y < cells_.height; ++y) {
    for (std::int64_t x = 0; x < cells_.width; ++x) {
      if (beliefs_[static_cast<std::size_t>(cells_.at(x, y) + 1)] == Masses{}) continue;
      const PatchIndex patch = fit_.cell_at(x, y).patch;
      marks.mark({patch, patch});
    }
  }
  list(marks.marked(max_memory_bytes));
}

void PictureSource::layers_of(PatchIndex patch, std::vector<LayerInfo>& out) const {
  LayerInfo info;
  info.patch = patch;
  info.step = static_cast<std::uint8_t>(fit_.step);
  out.push_back(info);
}

void PictureSource::load(const LayerInfo& info, Layer& out) const {
  out.reset(header_.types[info.type], fit_.step);
  const std::int64_t side = out.side();
  const std::int64_t x0 = info.patch.x * side - fit_.offset_x, y0 = info.patch.y * side - fit_.offset_y;
  const auto occupied = out.plane(0), free = out.plane(1);
  for (std::int64_t y = std::max<std::int64_t>(y0, 0); y < std::min(y0 + side, cells_.height); ++y) {
    for (std::int64_t x = std::max<std::int64_t>(x0, 0); x < std::min(x0 + side, cells_.width); ++x) {
      const Masses masses = beliefs_[static_cast<std::size_t>(cells_.at(x, y) + 1)];
      const auto cell = static_cast<std::size_t>((y - y0) * side + x - x0);
      occupied[cell] = masses.occupied;
      free[cell] = masses.free;
    }
  }
}

}  // namespace apgm::converters
