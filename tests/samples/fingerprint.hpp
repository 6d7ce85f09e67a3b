#pragma once

#include <bit>
#include <cstdint>

#include "apgm/core/map.hpp"

namespace apgm::samples {

/// FNV-1a over places, steps and the bits of all cells.
inline std::uint64_t fingerprint(const Map& map) {
  std::uint64_t hash = 0xcbf29ce484222325;
  const auto add = [&](std::uint32_t word) { hash = (hash ^ word) * 0x100000001b3; };
  for (const auto& [key, patch] : map.by_key()) {
    add(static_cast<std::uint32_t>(patch.index.x));
    add(static_cast<std::uint32_t>(patch.index.y));
    for (const auto& [type, layer] : patch.layers) {
      add(type);
      add(static_cast<std::uint32_t>(layer.step()));
      for (int c = 0; c < layer.channels(); ++c) {
        for (const float v : layer.plane(c)) add(std::bit_cast<std::uint32_t>(v));
      }
    }
  }
  return hash;
}

}  // namespace apgm::samples
