#include "tools/common/scan_memory.hpp"

#include <algorithm>
#include <numbers>
#include <variant>

namespace apgm::tools {

std::uint64_t layer_memory(const LayerType& type, int step) {
  return (std::uint64_t{sizeof(float)} << (2 * step)) * type.channels.size();
}

RequiredMemory required_memory(const Profile& profile, const Frame& frame, const LayerType& type) {
  RequiredMemory memory;
  for (const Requirement& r : profile.requirements) {
    if (r.layer != type.name) continue;
    const std::uint64_t layer_bytes = layer_memory(type, frame.step_for(r.cell_m));
    memory.least_layer_bytes =
        memory.layer_bytes == 0 ? layer_bytes : std::min(memory.least_layer_bytes, layer_bytes);
    memory.layer_bytes = std::max(memory.layer_bytes, layer_bytes);
    const auto* ring = std::get_if<Ring>(&r.area);
    if (ring == nullptr) continue;
    const double area_m2 = std::numbers::pi * (ring->to_m * ring->to_m - ring->from_m * ring->from_m);
    memory.total_bytes += area_m2 / (frame.edge_m() * frame.edge_m()) * static_cast<double>(layer_bytes);
  }
  return memory;
}

}  // namespace apgm::tools
