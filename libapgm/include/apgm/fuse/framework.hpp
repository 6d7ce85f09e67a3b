#pragma once

#include <optional>
#include <span>
#include <vector>

#include "apgm/core/map.hpp"
#include "apgm/fuse/combine.hpp"

namespace apgm {

/// A layer to fuse, with the type its own map declares (its policy governs resampling) and its trust.
struct FuseInput {
  const Layer* layer = nullptr;
  const LayerType* type = nullptr;
  float alpha = 1.0f;  ///< discounted by this before the combination; 1: as it is
};

/// r_fused = min(r_req, max r) (paper, Sec. III-B). `required` empty: the finest present.
int fused_step(std::span<const int> steps, std::optional<int> required);

/// F_layer (paper, Sec. III-B): brings every input to r_fused, then combines. Resample first, then fuse.
/// Reuses its scratch memory from call to call. One thread an object.
class LayerFuser {
 public:
  CombineReport fuse(std::span<const FuseInput> inputs, std::optional<int> required, Rule rule, Layer& out,
                     std::vector<float>* conflict = nullptr);

 private:
  std::vector<Layer> scratch_;
};

/// The types of a fused map: the union of the inputs' types by name. An `exclusive` type that two or more
/// inputs declare becomes `conditional`, since fused cells hold both free and occupied evidence.
/// @throws Error{kIncompatible} if one name stands for different hypotheses, channels or heights, or policies
/// of
///         different kinds that no rule joins
TypeTable fused_types(std::span<const TypeTable* const> tables);

/// F_grid over maps in memory (paper, Sec. III-B): union of patches, union of types, F_layer in each.
/// @throws Error{kIncompatible} if the frames differ
Map fuse_maps(std::span<const Map* const> maps, std::optional<int> required = {},
              Rule rule = Rule::kDempster);

}  // namespace apgm
