#pragma once

#include "bodies.hpp"

namespace apgm::test {

inline LayerType small_occupancy() { return LayerType::occupancy(); }

/// Cells of a layer of occupancy of step 1.
inline Planes small_cells() { return {{bits(0.5f), 0, 0, 0}, {0, bits(0.25f), 0, bits(0.75f)}}; }

/// Two patches, three layers of step 1: occupancy (type 0), a real channel "z" (type 1).
inline Parts small_map() {
  Parts parts;
  parts.header.types = TypeTable({small_occupancy(), LayerType::real("z", {"z"})});
  parts.layers = {stored_masked({0, 0}, 0, 1, small_occupancy(), small_cells()),
                  stored_constant({0, 0}, 1, 1, {bits(2.5f)}),
                  stored_masked({0, 1}, 0, 1, small_occupancy(), small_cells())};
  return parts;
}

/// The same with another body, and perhaps other cells, for the first layer.
inline Parts with_body(std::uint8_t encoding, const Planes& cells, std::string body) {
  Parts parts = small_map();
  parts.layers[0] = stored({0, 0}, 0, 1, encoding, cells, std::move(body));
  return parts;
}

}  // namespace apgm::test
