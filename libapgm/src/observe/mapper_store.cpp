#include <algorithm>
#include <utility>

#include "observe/mapper_state.hpp"

namespace apgm {

/// The layers of a patch that rests, aged to now, without those that faded. They rest no more.
Patch Mapper::State::take_from_rest(PatchIndex index) {
  Patch patch;
  const auto it = resting.find(curve_key(index));
  if (it == resting.end()) return patch;
  store->take(index, patch);
  const std::int64_t ticks = tick - it->second.tick;
  resting.erase(it);
  patch.index = index;
  if (ticks == 0 || !ageing.active()) return patch;
  for (auto layer = patch.layers.begin(); layer != patch.layers.end();) {
    const LayerType& type = live.types()[layer->first];
    ageing.apply(layer->second, type, ticks);
    layer = is_vacuous(layer->second, type) ? patch.layers.erase(layer) : std::next(layer);
  }
  return patch;
}

/// Gives a patch to the store, which must hold nothing of it. If that fails, its layers stay in memory.
void Mapper::State::put_to_rest(Patch& patch) {
  if (patch.layers.empty()) return;
  try {
    store->store(patch);
  } catch (...) {
    for (auto& [type, layer] : patch.layers) live.insert(patch.index, type, std::move(layer));
    throw;
  }
  Resting& notes = resting[curve_key(patch.index)];
  notes.index = patch.index;
  notes.tick = tick;
  notes.types.clear();
  for (auto& [type, layer] : patch.layers) {
    notes.types.push_back(type);
    live.spare(std::move(layer));
  }
}

void Mapper::State::bring_back(PatchIndex index) {
  if (resting.empty()) return;
  Patch patch = take_from_rest(index);
  for (auto it = patch.layers.begin(); it != patch.layers.end();) {
    const TypeId type = it->first;
    const auto wanted = profile ? required(index, type) : std::optional<int>(it->second.step());
    if (!wanted) {
      ++it;
      continue;
    }
    const Stopwatch watch(report.types[type].fuse_s);
    live.insert(index, type, std::move(it->second));
    live.touch(index, calls);
    it = patch.layers.erase(it);
    if (live.find(index, type)->step() == *wanted) continue;
    live.resample(index, type, *wanted);
    ++report.layers_resampled;
  }
  put_to_rest(patch);
}

void Mapper::State::rest(PatchIndex index, const std::vector<TypeId>& types) {
  if (store == nullptr) {
    for (const TypeId type : types) live.drop(index, type);
    return;
  }
  Patch patch = take_from_rest(index);
  patch.index = index;
  for (const TypeId type : types) patch.layers[type] = live.extract(index, type);
  put_to_rest(patch);
}

void Mapper::State::evict() {
  const std::uint64_t most = options.max_memory_bytes;
  if (most == 0 || profile || live.value_bytes() <= most) return;
  for (const PatchIndex index : live.by_last_use()) {
    std::vector<TypeId> types;
    for (const auto& [type, layer] : live.map().find(index)->layers) types.push_back(type);
    rest(index, types);
    if (live.value_bytes() <= most - most / 8) return;
  }
}

void Mapper::State::flush() {
  follows = false;  // what is required comes back with the next call
  for (const PatchIndex index : live.indices()) {
    std::vector<TypeId> types;
    for (const auto& [type, layer] : live.map().find(index)->layers) types.push_back(type);
    rest(index, types);
  }
  if (!ageing.active()) return;
  std::vector<PatchIndex> behind;
  for (const auto& [key, patch] : resting) {
    if (patch.tick != tick) behind.push_back(patch.index);
  }
  for (const PatchIndex index : behind) {
    Patch patch = take_from_rest(index);
    put_to_rest(patch);
  }
}

}  // namespace apgm
