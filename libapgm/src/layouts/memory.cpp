#include "apgm/layouts/memory.hpp"

#include "apgm/core/error.hpp"
#include "layouts/allocation.hpp"

namespace apgm {
namespace {

/// A node of a red-black tree: colour and three pointers before the value.
template <class Value>
constexpr std::uint64_t tree_node_bytes() {
  return layouts::heap_bytes(4 * sizeof(void*) + sizeof(Value));
}

std::uint64_t known_cells(const Layer& layer, const LayerType& type) {
  const Layer vacuous(type, 0);
  std::uint64_t known = 0;
  for (std::size_t i = 0; i < layer.cells(); ++i) {
    bool has_data = false;
    for (int c = 0; c < layer.channels(); ++c) {
      const float value = layer.plane(c)[i], none = vacuous.plane(c)[0];
      has_data |= value != none && (value == value || none == none);
    }
    known += has_data;
  }
  return known;
}

}  // namespace

double memory_factor(CellCount fixed, std::span<const CellCount> adaptive) {
  double values = 0;
  for (const CellCount& count : adaptive) values += count.cells * count.values_per_cell;
  if (!(values > 0)) throw Error(ErrorCode::kInvalidArgument, "the adaptive map stores no values");
  return fixed.cells * fixed.values_per_cell / values;
}

double cells_at_finer_step(double cells, int steps) {
  for (; steps > 0; --steps) cells *= 4;
  for (; steps < 0; ++steps) cells /= 4;
  return cells;
}

Footprint footprint(const Map& map) {
  Footprint f;
  for (const auto& [key, patch] : map.by_key()) {
    f.allocated_bytes += tree_node_bytes<std::pair<const std::uint64_t, Patch>>();
    for (const auto& [type, layer] : patch.layers) {
      f.cells += layer.cells();
      f.values += layer.cells() * static_cast<std::uint64_t>(layer.channels());
      f.known_cells += known_cells(layer, map.header().types[type]);
      // Planes begin at multiples of 64 bytes.
      const std::uint64_t plane = (layer.cells() * sizeof(float) + 63) / 64 * 64;
      f.allocated_bytes += tree_node_bytes<std::pair<const TypeId, Layer>>() +
                           layouts::heap_bytes(plane * static_cast<std::uint64_t>(layer.channels()));
    }
  }
  return f;
}

}  // namespace apgm
