#pragma once

#include <algorithm>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "apgm/core/map.hpp"
#include "apgm/core/map_changes.hpp"
#include "apgm/format/archive.hpp"
#include "apgm/format/reader.hpp"
#include "sample_map.hpp"

namespace apgm::test {

/// The layer of another map at the same place, by the name of its type.
inline const Layer* named_layer(const Map& map, PatchIndex patch, const LayerType& type) {
  const auto id = map.header().types.find(type.name);
  return id && map.header().types[*id] == type ? map.find(patch, *id) : nullptr;
}

inline bool same_layer(const Layer* a, const Layer* b) {
  if (a == nullptr || b == nullptr) return a == b;
  return a->stamp_ns == b->stamp_ns && same_cells(*a, *b);
}

/// Same layers by type name, cells, stamps.
inline bool same_content(const Map& a, const Map& b) {
  if (a.size() != b.size() || a.header().types != b.header().types) return false;
  return std::ranges::all_of(a.by_key(), [&](const auto& pair) {
    const Patch* other = b.find(pair.second.index);
    return other != nullptr && other->layers.size() == pair.second.layers.size() &&
           std::ranges::all_of(pair.second.layers, [&](const auto& layer) {
             return same_layer(&layer.second, b.find(pair.second.index, layer.first));
           });
  });
}

/// Layers of `base` that `next` lacks.
inline std::vector<MapChanges::Gone> gone_from(const Map& base, const Map& next) {
  std::vector<MapChanges::Gone> gone;
  for (const auto& [key, patch] : base.by_key()) {
    for (const auto& [type, layer] : patch.layers) {
      const std::string& name = base.header().types[type].name;
      const auto id = next.header().types.find(name);
      if (!id || next.find(patch.index, *id) == nullptr) gone.push_back({patch.index, name});
    }
  }
  return gone;
}

/// Puts the layers of `next` that differ from `base`. @return how many
template <typename Sink>
std::size_t put_changes(const Map& base, const Map& next, Sink& sink) {
  std::size_t count = 0;
  for (const auto& [key, patch] : next.by_key()) {
    std::vector<Parcel> parcels;
    for (const auto& [type, layer] : patch.layers) {
      if (same_layer(&layer, named_layer(base, patch.index, next.header().types[type]))) continue;
      Parcel& parcel = parcels.emplace_back();
      parcel.patch = patch.index;
      parcel.type = type;
      parcel.stamp_ns = layer.stamp_ns;
      parcel.cells = layer;
      sink.pack(parcel);
    }
    count += parcels.size();
    if (!parcels.empty()) sink.put(patch.index, parcels);
  }
  return count;
}

/// A commit that follows from two maps; `base` is what the archive holds.
inline CommitReport commit_map(const std::string& archive, const Map& base, const Map& next,
                               const CommitOptions& options = {}) {
  ArchiveWriter writer(archive, {.create = true});
  writer.begin(next.header(), gone_from(base, next), options);
  put_changes(base, next, writer);
  writer.finish();
  return writer.report();
}

inline Map read_commit(const Reader& reader) {
  Map map(reader.header());
  MapSink sink(map);
  stream(reader, sink);
  return map;
}

/// Another map near `map`: layers changed, added, taken away, stamped anew; at times other types.
inline Map changed_map(const Map& map, std::mt19937_64& rng, int changes) {
  static const std::vector<LayerType> kTypes = {LayerType::occupancy("b_occupancy"),
                                                LayerType::semantic("d_semantic", {"Road", "Marking"}),
                                                LayerType::real("f_speed", {"v"})};
  static const std::vector<LayerType> kMore = {LayerType::occupancy("a_first"),
                                               LayerType::occupancy("e_middle")};
  Map next = map;
  if (next.header().types.empty() || rng() % 8 == 0) {
    std::vector<LayerType> types(kTypes);
    for (const LayerType& type : kMore) {
      if (rng() % 2 == 0) types.push_back(type);
    }
    MapHeader header = map.header();
    header.types = TypeTable(types);
    next = Map(header);
    for (const auto& [key, patch] : map.by_key()) {
      for (const auto& [type, layer] : patch.layers) {
        const auto id = header.types.find(map.header().types[type].name);
        if (id) next.layer(patch.index, *id, layer.step()) = layer;
      }
    }
  }
  const TypeTable types = next.header().types;
  for (int i = 0; i < changes; ++i) {
    const PatchIndex index{static_cast<std::int32_t>(rng() % 5) - 2,
                           static_cast<std::int32_t>(rng() % 5) - 2};
    const auto type = static_cast<TypeId>(rng() % types.size());
    if (rng() % 4 == 0) {
      next.extract(index, type);
      continue;
    }
    Layer& layer = next.layer(index, type, static_cast<int>(rng() % 3));
    layer.stamp_ns = static_cast<std::int64_t>(rng() % 4);
    if (rng() % 4 == 0) continue;  // a stamp alone
    for (std::size_t c = 0; c < layer.cells(); ++c) {
      const float value = static_cast<float>(rng() % 16) / 32;
      layer.plane(0)[c] = value;
      if (types[type].is_evidence() && types[type].channels.size() > types[type].hypotheses.size()) {
        layer.plane(layer.channels() - 1)[c] = 1 - value;
      }
    }
  }
  next.prune();
  return next;
}

inline Map empty_map() {
  MapHeader header;
  header.frame.frame_id = "map";
  return Map(header);
}

}  // namespace apgm::test
