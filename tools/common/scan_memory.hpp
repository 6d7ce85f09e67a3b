#pragma once

#include <cstdint>

#include "apgm/core/frame.hpp"
#include "apgm/core/layer_type.hpp"
#include "apgm/observe/profile.hpp"

namespace apgm::tools {

/// Bytes of the values of a layer.
std::uint64_t layer_memory(const LayerType& type, int step);

struct RequiredMemory {
  std::uint64_t layer_bytes = 0;        ///< of the largest layer of the type
  std::uint64_t least_layer_bytes = 0;  ///< of the smallest
  /// Of the cells inside the rings of the type. Layers that reach out of them come on top, and polygons.
  double total_bytes = 0;
};

/// What a checked profile asks for of one type, once everything round the vehicle is observed.
RequiredMemory required_memory(const Profile& profile, const Frame& frame, const LayerType& type);

}  // namespace apgm::tools
