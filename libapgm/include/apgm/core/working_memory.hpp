#pragma once

#include <cstdint>

namespace apgm {

/// What a source or a sink needs beside the layers that go through it, for those that need much: operations
/// count it against their budget.
class WorkingMemory {
 public:
  virtual ~WorkingMemory() = default;
  /// Most memory that a thread keeps or takes in `load` or `pack`, the layer itself not counted.
  /// @param layer_bytes  values of the largest layer that passes
  virtual std::uint64_t working_bytes(std::uint64_t layer_bytes) const = 0;
};

/// That of a source or sink; 0 if it does not say.
template <typename Any>
std::uint64_t working_bytes(const Any& any, std::uint64_t layer_bytes) {
  const auto* says = dynamic_cast<const WorkingMemory*>(&any);
  return says == nullptr ? 0 : says->working_bytes(layer_bytes);
}

}  // namespace apgm
