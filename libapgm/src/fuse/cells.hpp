#pragma once

#include <array>
#include <cstddef>

#include "apgm/core/layer.hpp"

namespace apgm::fuse {

/// Neighbouring cells of a layer, or of a buffer: where each channel begins.
using ConstCells = std::array<const float*, 16>;
using Cells = std::array<float*, 16>;

/// The cells of `layer` from cell `first` on.
inline ConstCells cells_of(const Layer& layer, std::size_t first = 0) {
  ConstCells cells{};
  for (int c = 0; c < layer.channels(); ++c) {
    cells[static_cast<std::size_t>(c)] = layer.plane(c).data() + first;
  }
  return cells;
}
inline Cells cells_of(Layer& layer, std::size_t first = 0) {
  Cells cells{};
  for (int c = 0; c < layer.channels(); ++c) {
    cells[static_cast<std::size_t>(c)] = layer.plane(c).data() + first;
  }
  return cells;
}

}  // namespace apgm::fuse
