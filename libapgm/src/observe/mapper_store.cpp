#include <algorithm>
#include <utility>

#include "apgm/core/error.hpp"
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

/// What is wanted of a patch that rests comes into memory. Whatever fails on the way, each of its layers is
/// either in memory or at rest.
void Mapper::State::bring_back(PatchIndex index) {
  const auto notes = resting.find(curve_key(index));
  if (notes == resting.end()) return;
  std::map<TypeId, int> wanted;
  if (profile) {
    for (const TypeId type : notes->second.types) {
      if (const auto step = required(index, type)) wanted[type] = *step;
    }
  }
  Patch patch = take_from_rest(index);
  std::uint64_t bytes = 0;
  for (const auto& [type, layer] : patch.layers) {
    if (wanted.contains(type)) bytes += layer_bytes(type, wanted[type]);
  }
  try {
    check_room(bytes);
  } catch (...) {
    put_to_rest(patch);
    throw;
  }
  std::vector<TypeId> back;
  for (auto it = patch.layers.begin(); it != patch.layers.end();) {
    if (profile && !wanted.contains(it->first)) {
      ++it;
      continue;
    }
    live.insert(index, it->first, std::move(it->second));
    live.touch(index, calls);
    back.push_back(it->first);
    it = patch.layers.erase(it);
  }
  put_to_rest(patch);
  for (const TypeId type : back) {
    if (profile) fit(index, type, wanted[type]);
  }
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

std::uint64_t Mapper::State::layer_bytes(TypeId type, int step) const {
  return (std::uint64_t{4} << (2 * step)) * live.types()[type].channels.size();
}

/// What a profile requires stays in memory: there is nothing to make room with.
void Mapper::State::check_room(std::uint64_t more_bytes) const {
  const std::uint64_t most = options.max_memory_bytes;
  if (most == 0 || !profile || live.value_bytes() + more_bytes <= most) return;
  throw Error(ErrorCode::kLimit, "what profile '" + profile_name + "' requires takes more than the " +
                                     std::to_string(most) + " bytes of memory the mapper may use")
      .hint("allow more memory, or require larger cells, smaller areas or fewer layers");
}

/// @param in_hand  a patch that stays
void Mapper::State::evict(std::optional<PatchIndex> in_hand) {
  const std::uint64_t most = options.max_memory_bytes;
  if (most == 0 || profile || live.value_bytes() <= most) return;
  for (const PatchIndex index : live.by_last_use(calls)) {
    if (index == in_hand) continue;
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
