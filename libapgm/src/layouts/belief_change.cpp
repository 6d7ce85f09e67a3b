#include <algorithm>
#include <cmath>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/fuse/resample.hpp"
#include "apgm/layouts/comparison.hpp"
#include "layouts/layout_patches.hpp"

namespace apgm {
namespace {

/// Masses of one cell and what is left of them for Omega.
class Beliefs {
 public:
  Beliefs(const Layer& layer, const LayerType& type)
      : layer_(layer), hypotheses_(static_cast<int>(type.hypotheses.size())) {}

  bool load(std::size_t cell) {
    double sum = 0;
    for (int h = 0; h < hypotheses_; ++h) sum += mass(h, cell);
    cell_ = cell;
    share_ = (1 - sum) / hypotheses_;
    return sum > 0;
  }
  /// BetP of a single hypothesis: its mass and an equal share of m(Omega).
  double betp(int h) const { return mass(h, cell_) + share_; }
  int hypotheses() const { return hypotheses_; }

 private:
  double mass(int h, std::size_t cell) const { return static_cast<double>(layer_.plane(h)[cell]); }

  const Layer& layer_;
  int hypotheses_;
  std::size_t cell_ = 0;
  double share_ = 0;
};

std::uint64_t known_cells(const Layer& layer, const LayerType& type) {
  Beliefs beliefs(layer, type);
  std::uint64_t known = 0;
  for (std::size_t i = 0; i < layer.cells(); ++i) known += beliefs.load(i);
  return known;
}

/// Both of one step.
void compare(const Layer& before, const Layer& after, const LayerType& type, BeliefChange& change) {
  Beliefs was(before, type), is(after, type);
  for (std::size_t i = 0; i < before.cells(); ++i) {
    if (!was.load(i)) continue;
    ++change.known_cells;
    if (!is.load(i)) {
      ++change.lost_cells;
      continue;
    }
    double most = 0;
    for (int h = 0; h < was.hypotheses(); ++h) most = std::max(most, std::fabs(was.betp(h) - is.betp(h)));
    change.sum += most;
    change.most = std::max(change.most, most);
    change.obstacles += type.is_occupancy() && was.betp(0) > 0.5 && is.betp(0) <= 0.5;
  }
}

/// @param back  the layer of a type (of `types_back`) that came back for the patch; nullptr: none
template <class Back>
void compare(const Patch& patch, const TypeTable& types, const TypeTable& types_back, Back&& back,
             Layer& at_own_step, BeliefChange& change) {
  for (const auto& [type, layer] : patch.layers) {
    if (!types[type].is_evidence()) continue;
    const auto id = types_back.find(types[type].name);
    const Layer* after = id ? back(*id) : nullptr;
    if (after == nullptr) {
      const std::uint64_t known = known_cells(layer, types[type]);
      change.known_cells += known;
      change.lost_cells += known;
      continue;
    }
    if (types_back[*id].channels != types[type].channels) {
      throw Error(ErrorCode::kIncompatible, "layer '" + types[type].name + "' came back as another type");
    }
    if (after->step() != layer.step()) {
      resample(*after, types[type], layer.step(), at_own_step);
      after = &at_own_step;
    }
    compare(layer, *after, types[type], change);
  }
}

}  // namespace

BeliefChange belief_change(const Map& given_back, const Map& map) {
  const Frame &own = map.header().frame, &other = given_back.header().frame;
  if (own.edge_um != other.edge_um || own.datum_x_um != other.datum_x_um ||
      own.datum_y_um != other.datum_y_um) {
    throw Error(ErrorCode::kIncompatible, "the maps do not have the same patches");
  }
  BeliefChange change;
  Layer at_own_step;
  for (const auto& [key, patch] : map.by_key()) {
    compare(
        patch, map.header().types, given_back.header().types,
        [&, index = patch.index](TypeId id) { return given_back.find(index, id); }, at_own_step, change);
  }
  return change;
}

BeliefChange belief_change(const Layout& layout, const Map& map) {
  const TypeTable &types = map.header().types, &types_back = layout.schema().types();
  matching_ids(types, types_back);
  const layouts::LayoutPatches patches(layout, map.header().frame);
  BeliefChange change;
  Layer at_own_step;
  for (const auto& [key, patch] : map.by_key()) {
    const auto layers = patches.layers(patch.index);
    const auto back = [&](TypeId id) {
      const auto it = layers.find(id);
      return it == layers.end() ? nullptr : &it->second;
    };
    compare(patch, types, types_back, back, at_own_step, change);
  }
  return change;
}

}  // namespace apgm
