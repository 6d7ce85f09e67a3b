#pragma once

#include <cmath>
#include <cstring>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "apgm/layouts/layout.hpp"
#include "random_map.hpp"

namespace apgm::test {

/// The paper's cell: occupancy and three classes with m(Omega), 6 values.
inline TypeTable paper_types() {
  return TypeTable({LayerType::occupancy(), LayerType::semantic("semantic", {"road", "marking", "blocked"})});
}

inline Frame frame_at(std::int64_t datum_x_um, std::int64_t datum_y_um, std::int64_t edge_um = 12'800'000) {
  Frame frame;
  frame.datum_x_um = datum_x_um;
  frame.datum_y_um = datum_y_um;
  frame.edge_um = edge_um;
  return frame;
}

/// All cells of a layout, by their lower-left corner.
using CellMap = std::map<std::pair<std::int64_t, std::int64_t>, std::vector<float>>;
inline CellMap cells_of(const Layout& layout) {
  CellMap cells;
  const int values = layout.schema().values();
  layout.for_each_block([&](const CellBlock& block) {
    for (int b = 0; b < block.rows; ++b) {
      for (int a = 0; a < block.columns; ++a) {
        const float* cell = block.cells + b * block.row_stride + a * values;
        cells[{block.x_um + a * block.cell_x_um, block.y_um + b * block.cell_y_um}].assign(cell,
                                                                                           cell + values);
      }
    }
  });
  return cells;
}

inline bool same_bits(const float* a, const float* b, int values) {
  return std::memcmp(a, b, static_cast<std::size_t>(values) * sizeof(float)) == 0;
}
inline bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && same_bits(a.data(), b.data(), static_cast<int>(a.size()));
}

/// Writes random masses of the paper's types into a share of the cells.
inline void scribble(Layout& layout, Random& random, double share = 0.5) {
  const Area everywhere{-1'000'000'000'000, -1'000'000'000'000, 1'000'000'000'000, 1'000'000'000'000};
  const int values = layout.schema().values();
  layout.edit_blocks(everywhere, [&](const CellBlock& block, float* cells) {
    for (int b = 0; b < block.rows; ++b) {
      for (int a = 0; a < block.columns; ++a) {
        if (!random.chance(share)) continue;
        float* cell = cells + b * block.row_stride + a * values;
        cell[0] = static_cast<float>(random.in(0, 128)) / 256.0f;
        cell[1] = static_cast<float>(random.in(0, 128)) / 256.0f;
        if (values < 6) continue;
        cell[2] = static_cast<float>(random.in(0, 85)) / 256.0f;
        cell[3] = static_cast<float>(random.in(0, 85)) / 256.0f;
        cell[4] = static_cast<float>(random.in(0, 85)) / 256.0f;
        cell[5] = 1.0f - cell[2] - cell[3] - cell[4];
      }
    }
  });
}

/// The greatest difference of two layers of one shape; 1e9 if one holds a number where the other does not.
inline double greatest_difference(const Layer& a, const Layer& b) {
  double most = 0;
  for (int c = 0; c < a.channels(); ++c) {
    for (std::size_t i = 0; i < a.cells(); ++i) {
      const double x = static_cast<double>(a.plane(c)[i]), y = static_cast<double>(b.plane(c)[i]);
      if (std::isnan(x) && std::isnan(y)) continue;
      most = std::max(most, std::isnan(x) || std::isnan(y) ? 1e9 : std::fabs(x - y));
    }
  }
  return most;
}

}  // namespace apgm::test
