#include "apgm/fuse/map_fuser.hpp"

#include <algorithm>
#include <array>
#include <cassert>

#include "apgm/core/error.hpp"
#include "fuse/spare_layers.hpp"

namespace apgm {
namespace {

using ByKey = std::map<std::uint64_t, Patch>;

/// One of the maps, walked in key order.
struct Walk {
  const Map* map = nullptr;
  float alpha = 1.0f;
  std::vector<std::optional<TypeId>> own;  // by fused TypeId
  ByKey::const_iterator at, end;
  const Patch* here = nullptr;  // nullptr: has not the patch in hand

  const Layer* layer(TypeId fused) const {
    if (here == nullptr || !own[fused]) return nullptr;
    const auto it = here->layers.find(*own[fused]);
    return it == here->layers.end() ? nullptr : &it->second;
  }
  const LayerType& type(TypeId fused) const { return map->header().types[*own[fused]]; }
};

MapHeader fused_header(std::span<const Map* const> maps) {
  if (maps.empty()) throw Error(ErrorCode::kInvalidArgument, "there are no maps to fuse");
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

void check_alphas(std::span<const float> alphas, std::size_t maps) {
  if (!alphas.empty() && alphas.size() != maps) {
    throw Error(ErrorCode::kInvalidArgument, "there is not one discount factor for each map");
  }
  for (const float alpha : alphas) {
    if (alpha >= 0.0f && alpha <= 1.0f) continue;
    throw Error(ErrorCode::kInvalidArgument, "a discount factor lies between 0 and 1");
  }
}

}  // namespace

struct MapFuser::State {
  std::vector<Walk> walks;
  std::vector<Rule> rules;  // by fused TypeId
  std::vector<FuseInput> inputs;
  fuse::SpareLayers spare;
  std::vector<int> steps;
  LayerFuser fuser;
  std::optional<Map> result;
  CombineReport report;
  bool emptied = false;  // a patch of the output has lost its last layer

  void open(std::span<const Map* const> maps, const TypeTable& types, const FuseOptions& options);
  void run(Map& out, bool in_place, const FuseOptions& options);
  const Patch* next(std::uint64_t& key);
  void fuse_patch(PatchIndex index, const Patch* existing, Map& out, bool in_place,
                  const FuseOptions& options);
  bool fuse_layer(TypeId id, int required, const LayerType& type, Layer& out);
  bool gather(TypeId id);
  Layer blank(int required);
  void retire(Patch& patch, std::map<TypeId, Layer>::iterator it);
};

void MapFuser::State::open(std::span<const Map* const> maps, const TypeTable& types,
                           const FuseOptions& options) {
  walks.resize(maps.size());
  for (std::size_t i = 0; i < maps.size(); ++i) {
    Walk& walk = walks[i];
    walk.map = maps[i];
    walk.alpha = options.alphas.empty() ? 1.0f : options.alphas[i];
    walk.at = maps[i]->by_key().begin();
    walk.end = maps[i]->by_key().end();
    walk.own.clear();
    for (const LayerType& type : types) walk.own.push_back(maps[i]->header().types.find(type.name));
  }
  rules.clear();
  for (const LayerType& type : types) {
    const auto own = options.rule_of.find(type.name);
    rules.push_back(own == options.rule_of.end() ? options.rule : own->second);
  }
  report = {};
  emptied = false;
}

/// The next patch of the union, nullptr at the end; sets `here` of each walk.
const Patch* MapFuser::State::next(std::uint64_t& key) {
  const Patch* found = nullptr;
  for (const Walk& walk : walks) {
    if (walk.at == walk.end || (found != nullptr && walk.at->first >= key)) continue;
    key = walk.at->first;
    found = &walk.at->second;
  }
  if (found == nullptr) return nullptr;
  for (Walk& walk : walks) {
    const bool has = walk.at != walk.end && walk.at->first == key;
    walk.here = has ? &walk.at->second : nullptr;
    if (has) ++walk.at;
  }
  return found;
}

void MapFuser::State::run(Map& out, bool in_place, const FuseOptions& options) {
  // What the output holds already: the first map, or the result of the last call.
  auto old = out.by_key().begin();
  const auto old_end = out.by_key().end();
  const auto retire_patch = [&] {
    Patch& patch = out.patch(old->second.index);
    while (!patch.layers.empty()) retire(patch, patch.layers.begin());
    ++old;
  };
  std::uint64_t key = 0;
  while (const Patch* patch = next(key)) {
    while (old != old_end && old->first < key) retire_patch();
    const Patch* existing = old != old_end && old->first == key ? &old->second : nullptr;
    if (existing != nullptr) ++old;
    fuse_patch(patch->index, existing, out, in_place, options);
  }
  while (old != old_end) retire_patch();
  if (emptied) out.prune();
}

void MapFuser::State::fuse_patch(PatchIndex index, const Patch* existing, Map& out, bool in_place,
                                 const FuseOptions& options) {
  Patch* target = existing != nullptr ? &out.patch(index) : nullptr;
  const TypeTable& types = out.header().types;
  for (TypeId id = 0; id < types.size(); ++id) {
    const auto it = target != nullptr ? target->layers.find(id) : std::map<TypeId, Layer>::iterator{};
    const bool stands = target != nullptr && it != target->layers.end();
    const bool found = gather(id);
    if (!found && !stands) continue;
    std::optional<int> required;
    if (found) required = options.required ? options.required(index, types[id]) : kMaxStep;
    if (!required) {
      if (stands) retire(*target, it);
      continue;
    }
    if (stands) {
      const bool whole = in_place && inputs.size() == 1 && inputs[0].layer == &it->second &&
                         inputs[0].alpha == 1.0f && *required >= it->second.step();
      if (!whole && !fuse_layer(id, *required, types[id], it->second)) retire(*target, it);
      continue;
    }
    Layer layer = blank(*required);
    if (!fuse_layer(id, *required, types[id], layer)) {
      spare.keep(std::move(layer));
      continue;
    }
    if (target == nullptr) target = &out.patch(index);
    target->layers.emplace(id, std::move(layer));
  }
}

bool MapFuser::State::gather(TypeId id) {
  inputs.clear();
  for (const Walk& walk : walks) {
    const Layer* layer = walk.layer(id);
    if (layer != nullptr) inputs.push_back({layer, &walk.type(id), walk.alpha});
  }
  return !inputs.empty();
}

/// False if the result holds no data.
bool MapFuser::State::fuse_layer(TypeId id, int required, const LayerType& type, Layer& out) {
  report.total_conflicts += fuser.fuse(inputs, required, rules[id], out).total_conflicts;
  return !is_vacuous(out, type);
}

/// Memory for what the gathered inputs give.
Layer MapFuser::State::blank(int required) {
  steps.clear();
  for (const FuseInput& input : inputs) steps.push_back(input.layer->step());
  const int step = std::clamp(fused_step(steps, required), 0, kMaxStep);
  return spare.take((std::size_t{4} << (2 * step)) * static_cast<std::size_t>(inputs[0].layer->channels()));
}

void MapFuser::State::retire(Patch& patch, std::map<TypeId, Layer>::iterator it) {
  spare.keep(std::move(it->second));
  patch.layers.erase(it);
  emptied |= patch.layers.empty();
}

MapFuser::MapFuser() : state_(std::make_unique<State>()) {}
MapFuser::~MapFuser() = default;
MapFuser::MapFuser(MapFuser&&) noexcept = default;
MapFuser& MapFuser::operator=(MapFuser&&) noexcept = default;

const Map& MapFuser::fuse(std::span<const Map* const> maps, const FuseOptions& options) {
  std::optional<Map>& result = state_->result;
  try {
    MapHeader header = fused_header(maps);
    check_alphas(options.alphas, maps.size());
    const bool fits =
        result && result->header().frame == header.frame && result->header().types == header.types;
    if (!fits)
      result.emplace(std::move(header));
    else
      result->set_stamp_ns(header.stamp_ns);
    state_->open(maps, result->header().types, options);
    state_->run(*result, false, options);
  } catch (...) {
    result.reset();
    throw;
  }
  return *result;
}

void MapFuser::fuse_into(Map& map, std::span<const Map* const> others, const FuseOptions& options) {
  assert(std::find(others.begin(), others.end(), &map) == others.end());
  std::vector<const Map*> maps{&map};
  maps.insert(maps.end(), others.begin(), others.end());
  const MapHeader header = fused_header(maps);
  check_alphas(options.alphas, maps.size());
  if (header.types != map.header().types) {
    throw Error(ErrorCode::kIncompatible, "the map to fuse into has not the layer types of the result")
        .hint("give it the fused types of all maps first");
  }
  state_->open(maps, map.header().types, options);
  state_->run(map, true, options);
  map.set_stamp_ns(header.stamp_ns);
}

const CombineReport& MapFuser::report() const { return state_->report; }

Map MapFuser::take() {
  assert(state_->result);
  Map out = std::move(*state_->result);
  state_->result.reset();
  return out;
}

Map fuse_maps(std::span<const Map* const> maps, std::optional<int> required, Rule rule) {
  MapFuser fuser;
  FuseOptions options;
  options.rule = rule;
  if (required) options.required = [&](PatchIndex, const LayerType&) { return required; };
  fuser.fuse(maps, options);
  return fuser.take();
}

}  // namespace apgm
