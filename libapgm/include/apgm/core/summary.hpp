#pragma once

#include <algorithm>
#include <optional>

#include "apgm/core/source.hpp"

namespace apgm {

/// The finest step of the layers of a type; nullopt if there are none.
inline std::optional<int> finest_step(const Summary::OfType& type) {
  for (int step = kMaxStep; step >= 0; --step) {
    if (type.layers_at[static_cast<std::size_t>(step)] != 0) return step;
  }
  return {};
}

/// The same of all layers.
inline std::optional<int> finest_step(const Summary& summary) {
  std::optional<int> finest;
  for (const Summary::OfType& type : summary.types) finest = std::max(finest, finest_step(type));
  return finest;
}

/// The coarsest step of all layers; nullopt if there are none.
inline std::optional<int> coarsest_step(const Summary& summary) {
  for (int step = 0; step <= kMaxStep; ++step) {
    for (const Summary::OfType& type : summary.types) {
      if (type.layers_at[static_cast<std::size_t>(step)] != 0) return step;
    }
  }
  return {};
}

}  // namespace apgm
