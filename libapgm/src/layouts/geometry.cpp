#include "layouts/geometry.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "apgm/core/error.hpp"

namespace apgm {
namespace {

constexpr double kMaxCoordinate_m = 4e9;
constexpr std::int64_t kNanoPerMicro = 1000;

std::int64_t from_datum(double metres, std::int64_t datum_um) {
  if (!std::isfinite(metres)) throw Error(ErrorCode::kInvalidArgument, "a coordinate is not a finite number");
  if (std::fabs(metres) > kMaxCoordinate_m) {
    throw Error(ErrorCode::kLimit, "a coordinate lies beyond 4e9 m");
  }
  // At most 4e18 and 1e18: the difference fits.
  return floor_div(std::llrint(metres * 1e9) - datum_um * kNanoPerMicro, kNanoPerMicro);
}

std::int32_t patch_index(std::int64_t from_datum_um, std::int64_t edge_um) {
  const std::int64_t i = floor_div(from_datum_um, edge_um);
  if (i < std::numeric_limits<std::int32_t>::min() || i > std::numeric_limits<std::int32_t>::max()) {
    throw Error(ErrorCode::kLimit, "an area lies outside all patch indices");
  }
  return static_cast<std::int32_t>(i);
}

}  // namespace

Area Area::shared(const Area& o) const {
  return {std::max(x0_um, o.x0_um), std::max(y0_um, o.y0_um), std::min(x1_um, o.x1_um),
          std::min(y1_um, o.y1_um)};
}

Area area_of(const Frame& frame, PatchIndex patch) {
  const auto corner = [&](std::int32_t index, std::int64_t datum_um) {
    const __int128 at = static_cast<__int128>(index) * frame.edge_um + datum_um;
    if (at > 4'000'000'000'000'000 || at < -4'000'000'000'000'000) {
      throw Error(ErrorCode::kLimit, "a patch lies beyond 4e9 m");
    }
    return static_cast<std::int64_t>(at);
  };
  const std::int64_t x = corner(patch.x, frame.datum_x_um), y = corner(patch.y, frame.datum_y_um);
  return {x, y, x + frame.edge_um, y + frame.edge_um};
}

namespace layouts {

Offset offset_of(const Frame& frame, Point p) {
  return {from_datum(p.x_m, frame.datum_x_um), from_datum(p.y_m, frame.datum_y_um)};
}

std::int64_t whole_um(double metres, const std::string& what) {
  if (!std::isfinite(metres) || std::fabs(metres) > 1e6) {
    throw Error(ErrorCode::kInvalidArgument, what + " is not a number of metres within 1e6");
  }
  const std::int64_t um = std::llrint(metres * 1e6);
  if (std::fabs(metres * 1e6 - static_cast<double>(um)) > 1e-3) {
    throw Error(ErrorCode::kInvalidArgument, what + " is not a whole number of micrometres");
  }
  return um;
}

PatchRange patches_in(const Frame& frame, const Area& area) {
  if (area.empty()) return {};
  const auto index = [&](std::int64_t at, std::int64_t datum) {
    return patch_index(at - datum, frame.edge_um);
  };
  return {{index(area.x0_um, frame.datum_x_um), index(area.y0_um, frame.datum_y_um)},
          {index(area.x1_um - 1, frame.datum_x_um), index(area.y1_um - 1, frame.datum_y_um)}};
}

CellWindow cells_in(const CellBlock& block, const Area& area) {
  const Area s = block.area().shared(area);
  if (s.empty()) return {};
  const auto low = [](std::int64_t at, std::int64_t cell) { return static_cast<int>(at / cell); };
  const auto high = [](std::int64_t at, std::int64_t cell) {
    return static_cast<int>((at + cell - 1) / cell);
  };
  return {low(s.x0_um - block.x_um, block.cell_x_um), high(s.x1_um - block.x_um, block.cell_x_um),
          low(s.y0_um - block.y_um, block.cell_y_um), high(s.y1_um - block.y_um, block.cell_y_um)};
}

Footprint count_cells(const Layout& layout) {
  Footprint f;
  const CellSchema& schema = layout.schema();
  layout.for_each_block([&](const CellBlock& block) {
    f.cells += static_cast<std::uint64_t>(block.columns) * static_cast<std::uint64_t>(block.rows);
    for (int b = 0; b < block.rows; ++b) {
      const float* cell = block.cells + b * block.row_stride;
      for (int a = 0; a < block.columns; ++a, cell += schema.values()) f.known_cells += schema.is_known(cell);
    }
  });
  f.values = f.cells * static_cast<std::uint64_t>(schema.values());
  return f;
}

}  // namespace layouts
}  // namespace apgm
