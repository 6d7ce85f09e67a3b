#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "apgm/core/map.hpp"
#include "apgm/fuse/framework.hpp"

namespace apgm {

/// What is asked of a fusion of maps.
struct FuseOptions {
  Rule rule = Rule::kDempster;
  std::map<std::string, Rule, std::less<>> rule_of;  ///< by type name, in place of `rule`
  std::vector<float> alphas;  ///< trust in each map, in [0, 1], in the order of the maps; empty: 1
  /// r_req of a type in a patch (paper, Sec. III-B); nullopt: nobody requires it, the layer is dropped. No
  /// function: the finest present everywhere, as with kMaxStep.
  std::function<std::optional<int>(PatchIndex, const LayerType&)> required;
};

/// F_grid over maps in memory (paper, Sec. III-B): union of patches, union of types, F_layer in each. Layers
/// and patches without data are left out.
///
/// Layer memory is kept from call to call: page faults of fresh memory cost more than the arithmetic. One
/// thread an object. Guarantees of combine() and resample() hold: same bytes for any order of the maps
/// (Rule::kLast excepted).
class MapFuser {
 public:
  MapFuser();
  ~MapFuser();
  MapFuser(MapFuser&&) noexcept;
  MapFuser& operator=(MapFuser&&) noexcept;

  /// The fused map; it belongs to this object and holds until the next call or take().
  /// @throws Error{kIncompatible} if the frames differ or types do not join (see fused_types());
  ///         {kInvalidArgument} without maps, or if the alphas do not fit; {kLimit} if `required` gives a
  ///         step below 0. After an error there is no result
  const Map& fuse(std::span<const Map* const> maps, const FuseOptions& options = {});

  /// Fuses `others` into `map` in place, which comes first in the order and in the alphas: the cheapest way,
  /// since a layer that only `map` has costs nothing where it stands. `map` is none of the others.
  /// @throws as fuse(), and Error{kIncompatible} if the fused types are not those of `map` (see
  ///         Map::set_types()). `map` is unchanged then, but for errors that `required` brings
  void fuse_into(Map& map, std::span<const Map* const> others, const FuseOptions& options = {});

  /// Cells of total conflict in all layers of the last call.
  const CombineReport& report() const;
  /// Hands the result of the last fuse() over, with its memory. Requires that there is one.
  Map take();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace apgm
