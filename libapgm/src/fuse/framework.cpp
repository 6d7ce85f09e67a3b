#include "apgm/fuse/framework.hpp"

#include <algorithm>
#include <cassert>
#include <map>
#include <string>

#include "apgm/core/error.hpp"
#include "apgm/fuse/resample.hpp"

namespace apgm {
namespace {

/// What the tables say of one name.
struct Joined {
  LayerType type;
  int exclusive = 0;  // tables that declare kExclusive
};

void join(Joined& known, const LayerType& type) {
  const auto fail = [&](const std::string& what) {
    throw Error(ErrorCode::kIncompatible,
                "layer type '" + type.name + "' differs between the maps in its " + what);
  };
  if (type.hypotheses != known.type.hypotheses) fail("hypotheses");
  if (type.channels != known.type.channels) fail("channels");
  if (type.slab != known.type.slab) fail("height interval");
  if (type.policy == Policy::kExclusive) {
    ++known.exclusive;
    return;
  }
  if (known.type.policy == Policy::kExclusive) known.type.policy = type.policy;
  if (known.type.policy != type.policy) fail("resampling policy");
}

/// Where the layers of one type and patch stand in each map.
void collect(std::span<const Map* const> maps, PatchIndex patch, const std::string& name,
             std::vector<FuseInput>& out) {
  out.clear();
  for (const Map* map : maps) {
    const auto type = map->header().types.find(name);
    if (!type) continue;
    const Layer* layer = map->find(patch, *type);
    if (layer != nullptr) out.push_back({layer, &map->header().types[*type], 1.0f});
  }
}

MapHeader fused_header(std::span<const Map* const> maps) {
  MapHeader header;
  header.frame = maps[0]->header().frame;
  std::vector<const TypeTable*> tables;
  for (const Map* map : maps) {
    if (map->header().frame != header.frame) {
      throw Error(ErrorCode::kIncompatible, "the frames of the maps differ")
          .hint("regrid the maps to one frame first");
    }
    tables.push_back(&map->header().types);
    header.stamp_ns = std::max(header.stamp_ns, map->header().stamp_ns);
  }
  header.types = fused_types(tables);
  return header;
}

}  // namespace

int fused_step(std::span<const int> steps, std::optional<int> required) {
  assert(!steps.empty());
  const int finest = *std::max_element(steps.begin(), steps.end());
  return required ? std::min(*required, finest) : finest;
}

CombineReport LayerFuser::fuse(std::span<const FuseInput> inputs, std::optional<int> required, Rule rule,
                               Layer& out, std::vector<float>* conflict) {
  assert(!inputs.empty());
  std::vector<int> steps;
  for (const FuseInput& input : inputs) steps.push_back(input.layer->step());
  const int step = fused_step(steps, required);
  if (step < 0 || step > kMaxStep) throw Error(ErrorCode::kLimit, "a resolution step lies in 0..11");

  if (scratch_.size() < inputs.size()) scratch_.resize(inputs.size());
  std::vector<const Layer*> layers;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const FuseInput& input = inputs[i];
    if (!input.type->same_space(*inputs[0].type)) {
      throw Error(ErrorCode::kIncompatible, "layers of different types cannot be fused: '" +
                                                inputs[0].type->name + "' and '" + input.type->name + "'");
    }
    if (input.layer->step() == step && input.alpha == 1.0f) {
      layers.push_back(input.layer);
      continue;
    }
    resample(*input.layer, *input.type, step, scratch_[i]);
    discount(scratch_[i], *input.type, input.alpha);
    layers.push_back(&scratch_[i]);
  }
  float* k = nullptr;
  if (conflict != nullptr) {
    conflict->resize(layers[0]->cells());
    k = conflict->data();
  }
  return combine(layers, *inputs[0].type, rule, out, k);
}

TypeTable fused_types(std::span<const TypeTable* const> tables) {
  std::map<std::string, Joined> by_name;
  for (const TypeTable* table : tables) {
    for (const LayerType& type : *table) {
      const auto [it, added] =
          by_name.try_emplace(type.name, Joined{type, type.policy == Policy::kExclusive});
      if (!added) join(it->second, type);
    }
  }
  std::vector<LayerType> types;
  for (auto& [name, joined] : by_name) {
    if (joined.type.policy == Policy::kExclusive && joined.exclusive > 1) {
      joined.type.policy = Policy::kConditional;
    }
    types.push_back(std::move(joined.type));
  }
  return TypeTable(std::move(types));
}

Map fuse_maps(std::span<const Map* const> maps, std::optional<int> required, Rule rule) {
  assert(!maps.empty());
  Map out(fused_header(maps));
  std::map<std::uint64_t, PatchIndex> patches;
  for (const Map* map : maps) {
    for (const auto& [key, patch] : map->by_key()) patches.emplace(key, patch.index);
  }
  LayerFuser fuser;
  std::vector<FuseInput> inputs;
  const TypeTable& types = out.header().types;
  for (const auto& [key, index] : patches) {
    for (TypeId id = 0; id < types.size(); ++id) {
      collect(maps, index, types[id].name, inputs);
      if (inputs.empty()) continue;
      Layer layer;
      fuser.fuse(inputs, required, rule, layer);
      if (!is_vacuous(layer, types[id])) out.patch(index).layers.insert_or_assign(id, std::move(layer));
    }
  }
  return out;
}

}  // namespace apgm
