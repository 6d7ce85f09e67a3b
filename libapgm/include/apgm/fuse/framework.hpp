#pragma once

#include <memory>
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

/// F_layer (paper, Sec. III-B): brings every input to r_fused, then discounts, then combines. Resample first,
/// then fuse.
///
/// Inputs at r_fused with full trust are read where they stand. The others are made in memory of its own,
/// large ones in strips of rows that stay in the cache and are combined at once (ResampledView). Scratch
/// memory is kept from call to call. One thread an object.
class LayerFuser {
 public:
  LayerFuser();
  ~LayerFuser();
  LayerFuser(LayerFuser&&) noexcept;
  LayerFuser& operator=(LayerFuser&&) noexcept;

  /// @param out       receives the result; may be a layer of the inputs
  /// @param conflict  nullptr, or receives K of each cell (see combine())
  /// @throws Error{kIncompatible} if the types of the inputs differ, {kLimit} if `required` is below 0,
  ///         {kInvalidArgument} if an alpha is not in [0, 1]
  CombineReport fuse(std::span<const FuseInput> inputs, std::optional<int> required, Rule rule, Layer& out,
                     std::vector<float>* conflict = nullptr);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The types of a fused map: the union of the inputs' types by name. An `exclusive` type that two or more
/// inputs declare becomes `conditional`, since fused cells hold both free and occupied evidence.
/// @throws Error{kIncompatible} if one name stands for different hypotheses, channels or heights, or policies
/// of
///         different kinds that no rule joins
TypeTable fused_types(std::span<const TypeTable* const> tables);

/// F_grid over maps in memory (paper, Sec. III-B): union of patches, union of types, F_layer in each.
/// MapFuser does the same again and again without fresh memory, and takes more wishes.
/// @throws Error{kIncompatible} if the frames differ
Map fuse_maps(std::span<const Map* const> maps, std::optional<int> required = {},
              Rule rule = Rule::kDempster);

}  // namespace apgm
