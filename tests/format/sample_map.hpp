#pragma once

#include <random>
#include <string>
#include <vector>

#include "apgm/core/map.hpp"
#include "apgm/format/reader.hpp"
#include "apgm/format/writer.hpp"

namespace apgm::test {

inline float unit(std::mt19937_64& rng) { return static_cast<float>(rng() >> 40) * 0x1p-24f; }

/// A map with every kind of layer: continuous, stepped, constant, semantic, real; several steps; negative
/// indices.
inline Map sample_map(std::uint64_t seed, int patches = 6, int max_step = 5) {
  std::mt19937_64 rng(seed);
  MapHeader header;
  header.frame.epsg = 32632;
  header.frame.datum_x_um = 570'000'000'000;
  header.types =
      TypeTable({LayerType::occupancy(), LayerType::semantic("semantic", {"Road", "Marking", "Blocked"}),
                 LayerType::real("velocity", {"vx", "vy"})});
  header.metadata["site"] = "Ulm \xe2\x80\x93 test";
  header.history.push_back({"sample", {"a", "b"}, "{\"seed\":1}"});
  Map map(header);
  for (int i = 0; i < patches; ++i) {
    const PatchIndex index{static_cast<std::int32_t>(rng() % 9) - 4,
                           static_cast<std::int32_t>(rng() % 9) - 4};
    Layer& occ = map.layer(index, *header.types.find("occupancy"), static_cast<int>(rng() % (max_step + 1)));
    const bool stepped = rng() % 2 == 0;
    for (std::size_t c = 0; c < occ.cells(); ++c) {
      const auto kind = rng() % 3;
      const float value = stepped ? static_cast<float>(rng() % 8) / 8 : unit(rng);
      occ.plane(0)[c] = kind == 1 ? value : 0.0f;
      occ.plane(1)[c] = kind == 2 ? value : 0.0f;
    }
    occ.stamp_ns = 1000 + i;
    if (rng() % 2 == 0) {
      Layer& sem = map.layer(index, *header.types.find("semantic"), static_cast<int>(rng() % 4));
      for (std::size_t c = 0; c < sem.cells(); ++c) {
        const float mass = unit(rng) * 0.5f;
        const auto hypothesis = static_cast<int>(rng() % 3);
        for (int k = 0; k < 3; ++k) sem.plane(k)[c] = k == hypothesis ? mass : 0.0f;
        sem.plane(3)[c] = 1 - mass;
      }
    }
    if (rng() % 3 == 0) {
      Layer& vel = map.layer(index, *header.types.find("velocity"), 2);
      for (std::size_t c = 0; c < vel.cells(); c += 2) vel.plane(0)[c] = vel.plane(1)[c] = 10 * unit(rng) - 5;
    }
    Layer& constant = map.layer({index.x, 100}, 0, 3);
    std::ranges::fill(constant.plane(1), 0.75f);
  }
  map.prune();
  return map;
}

/// Streams a map into a sink, one patch after the other.
inline void stream(const PatchSource& source, PatchSink& sink) {
  const auto cursor = source.patches();
  PatchInfo patch;
  while (cursor->next(patch)) {
    std::vector<Parcel> parcels(patch.layers.size());
    for (std::size_t i = 0; i < parcels.size(); ++i) {
      parcels[i].patch = patch.patch;
      parcels[i].type = patch.layers[i].type;
      parcels[i].stamp_ns = patch.layers[i].stamp_ns;
      source.load(patch.layers[i], parcels[i].cells);
      sink.pack(parcels[i]);
    }
    sink.put(patch.patch, parcels);
  }
  sink.finish();
}

inline WriteReport write_map(const PatchSource& source, const std::string& path,
                             const WriterOptions& options = {}) {
  Writer writer(path, source.header(), options);
  stream(source, writer);
  return writer.report();
}

inline Map read_map(const std::string& path) {
  const Reader reader(path);
  Map map(reader.header());
  MapSink sink(map);
  stream(reader, sink);
  return map;
}

inline bool same_map(const Map& a, const Map& b) {
  if (a.size() != b.size()) return false;
  for (const auto& [key, patch] : a.by_key()) {
    const Patch* other = b.find(patch.index);
    if (other == nullptr || other->layers.size() != patch.layers.size()) return false;
    for (const auto& [type, layer] : patch.layers) {
      const Layer* l = b.find(patch.index, type);
      if (l == nullptr || !same_cells(*l, layer)) return false;
    }
  }
  return true;
}

}  // namespace apgm::test
