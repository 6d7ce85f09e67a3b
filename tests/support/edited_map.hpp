#pragma once

#include <limits>

#include "random_map.hpp"

namespace apgm::test {

struct Edits {
  double changed = 0.15;  ///< of the layers: other cells, at a step of their own
  double restamped = 0.1;
  double dropped = 0.15;
  double added = 0.2;       ///< new layers, for each there was
  bool other_types = true;  ///< types may come, go, and stand for another space
};

/// A type of the name of `type` whose cells mean something else.
inline LayerType other_space(const LayerType& type) {
  LayerType other = type;
  if (type.is_evidence()) {
    other.hypotheses.back() += "_too";
  } else {
    other.channels.emplace_back("too");
  }
  return other;
}

inline std::vector<LayerType> edited_types(const TypeTable& types, Random& random) {
  std::vector<LayerType> all;
  for (const LayerType& type : types) {
    if (random.chance(0.15)) continue;
    all.push_back(random.chance(0.15) ? other_space(type) : type);
  }
  // "a" and "z" shift the numbers of all, or of none.
  for (const char* name : {"a", "z"}) {
    if (random.chance(0.3)) all.push_back(LayerType::occupancy(name));
  }
  return all;
}

inline Layer random_layer(const LayerType& type, Random& random) {
  Layer layer(type, random.in(1, 5));
  while (is_vacuous(layer, type)) detail::fill_layer(type, random, layer);
  layer.stamp_ns = random.in(0, 1'000'000);
  return layer;
}

/// What `map` may have become: the same for the same seed.
inline Map edited_map(const Map& map, std::uint64_t seed, const Edits& edits = {}) {
  Random random(seed);
  MapHeader header = map.header();
  if (edits.other_types) header.types = TypeTable(edited_types(map.header().types, random));
  header.metadata["edited"] = std::to_string(seed);
  header.history.push_back({"edit", {"unknown"}, "{}"});
  header.stamp_ns = random.in(0, 1'000'000);
  Map out(std::move(header));
  const TypeTable& types = out.header().types;
  for (const auto& [key, patch] : map.by_key()) {
    for (const auto& [id, layer] : patch.layers) {
      const auto type = types.find(map.header().types[id].name);
      if (!types.empty() && random.chance(edits.added)) {
        const auto any = static_cast<TypeId>(random.below(static_cast<int>(types.size())));
        const PatchIndex at{patch.index.x + random.in(-9, 9), patch.index.y - random.in(-9, 9)};
        if (map.find(at) == nullptr) out.patch(at).layers[any] = random_layer(types[any], random);
      }
      if (!type || random.chance(edits.dropped)) continue;
      const bool same = types[*type].same_space(map.header().types[id]);
      Layer& to = out.patch(patch.index).layers[*type];
      to = same && !random.chance(edits.changed) ? layer : random_layer(types[*type], random);
      if (random.chance(edits.restamped)) to.stamp_ns = random.in(0, 1'000'000);
    }
  }
  out.prune();
  return out;
}

}  // namespace apgm::test
