#pragma once

#include <array>
#include <memory>

#include "apgm/core/source.hpp"
#include "block.hpp"

namespace apgm::format {

/// Hash over step and cells; equal for equal cells (docs/format.md, "Content hashes").
std::uint64_t content_hash(const Layer& layer);

/// Hash over what gives a type's cells their meaning: name, hypotheses, channels, slab. Not the policy.
std::uint64_t space_hash(const LayerType& type);

/// Folds a map's content into its id, layer by layer in file order (docs/format.md, "Content id").
class ContentId {
 public:
  explicit ContentId(const MapHeader& header);
  ~ContentId();
  void add(PatchIndex patch, TypeId type, std::uint8_t step, std::uint64_t layer_hash);
  std::array<std::byte, 16> value() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// 32 hex digits.
std::string to_hex(const std::array<std::byte, 16>& id);

}  // namespace apgm::format
