#include "observe/grid_point.hpp"
#include "observe/mapper_state.hpp"

namespace apgm {
namespace {

std::vector<TypeId> types_at(const Map& map, PatchIndex index) {
  std::vector<TypeId> types;
  if (const Patch* patch = map.find(index)) {
    for (const auto& [type, layer] : patch->layers) types.push_back(type);
  }
  return types;
}

/// Patches in a range, without overflow.
double area(const PatchRange& range) {
  if (range.empty()) return 0;
  return (1.0 + range.max.x - range.min.x) * (1.0 + range.max.y - range.min.y);
}

}  // namespace

void Mapper::State::advance(std::int64_t stamp_ns) {
  if (now_ns && stamp_ns <= *now_ns) return;
  const std::int64_t next = ageing.tick_of(stamp_ns);
  if (now_ns) {
    age_all(next - tick);
  } else {
    // What was fused without a time is of the first time there is.
    for (auto& [key, patch] : resting) patch.tick = next;
  }
  now_ns = stamp_ns;
  tick = next;
}

void Mapper::State::age_all(std::int64_t ticks) {
  if (ticks == 0 || !ageing.active()) return;
  for (const PatchIndex index : live.indices()) {
    for (const TypeId id : types_at(live.map(), index)) {
      const LayerType& type = live.types()[id];
      if (!type.is_evidence()) continue;
      const Stopwatch watch(report.types[id].fuse_s);
      Layer& layer = *live.find(index, id);
      ageing.apply(layer, type, ticks);
      if (is_vacuous(layer, type)) {
        live.drop(index, id);
      } else {
        live.mark(index, id);
      }
    }
  }
}

std::optional<int> Mapper::State::required(PatchIndex index, TypeId type) {
  const auto [it, added] = steps[type].try_emplace(observe::patch_key(index));
  if (added) it->second = profile->required_step(index, live.types()[type].name, *vehicle);
  return it->second;
}

void Mapper::State::follow() {
  if (follows) return;
  for (auto& of_type : steps) of_type.clear();
  if (profile && vehicle) {
    fit_to_requirements();
    bring_wanted_back();
  }
  follows = true;
}

/// Brings a layer in memory to `step`.
void Mapper::State::fit(PatchIndex index, TypeId type, int step) {
  const Layer& layer = *live.find(index, type);
  if (layer.step() == step) return;
  const Stopwatch watch(report.types[type].fuse_s);
  const std::uint64_t before = layer.value_bytes(), after = layer_bytes(type, step);
  if (after > before) check_room(after - before);
  live.resample(index, type, step);
  ++report.layers_resampled;
  floor_unknown(index, type);
  if (is_vacuous(layer, live.types()[type])) live.drop(index, type);  // masses near 0, divided
}

/// Merging adds evidence up: merged cells, too, keep their unknown mass.
void Mapper::State::floor_unknown(PatchIndex index, TypeId type) {
  Layer& layer = *live.find(index, type);
  observe::keep_unknown(layer, live.types()[type], {0, layer.side()},
                        static_cast<float>(options.min_unknown));
}

/// What leaves and what becomes smaller makes room for what becomes larger.
void Mapper::State::fit_to_requirements() {
  std::vector<std::pair<PatchIndex, TypeId>> growing;
  for (const PatchIndex index : live.indices()) {
    std::vector<TypeId> leaving;
    const std::vector<TypeId> present = types_at(live.map(), index);
    for (const TypeId type : present) {
      const auto step = required(index, type);
      if (!step) {
        leaving.push_back(type);
      } else if (*step > live.find(index, type)->step()) {
        growing.emplace_back(index, type);
      } else {
        fit(index, type, *step);
      }
    }
    if (leaving.empty()) continue;
    rest(index, leaving);
    if (leaving.size() == present.size()) ++report.patches_dropped;
  }
  for (const auto& [index, type] : growing) fit(index, type, *required(index, type));
}

void Mapper::State::bring_wanted_back() {
  if (resting.empty()) return;
  const PatchRange reach = profile->reach(*vehicle);
  std::vector<PatchIndex> wanted;
  const auto look_at = [&](const Resting& patch) {
    for (const TypeId type : patch.types) {
      if (!required(patch.index, type)) continue;
      wanted.push_back(patch.index);
      return;
    }
  };
  if (area(reach) < static_cast<double>(resting.size())) {
    for (std::int64_t y = reach.min.y; y <= reach.max.y; ++y) {
      for (std::int64_t x = reach.min.x; x <= reach.max.x; ++x) {
        const PatchIndex index{static_cast<std::int32_t>(x), static_cast<std::int32_t>(y)};
        const auto it = resting.find(curve_key(index));
        if (it != resting.end()) look_at(it->second);
      }
    }
  } else {
    for (const auto& [key, patch] : resting) {
      if (reach.contains(patch.index)) look_at(patch);
    }
  }
  for (const PatchIndex index : wanted) bring_back(index);
}

}  // namespace apgm
