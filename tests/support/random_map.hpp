#pragma once

#include <algorithm>
#include <cstdint>
#include <ostream>
#include <string>
#include <vector>

#include "apgm/core/map.hpp"

namespace apgm::test {

/// splitmix64: the same numbers on every platform, unlike the distributions of <random>.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  std::uint64_t next() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }
  /// In [0, n).
  int below(int n) { return static_cast<int>(next() % static_cast<std::uint64_t>(n)); }
  /// In [lo, hi].
  int in(int lo, int hi) { return lo + below(hi - lo + 1); }
  /// In [0, 1).
  double unit() { return static_cast<double>(next() >> 11) * 0x1p-53; }
  bool chance(double p) { return unit() < p; }

 private:
  std::uint64_t state_;
};

struct RandomMapOptions {
  Frame frame;
  PatchRange range{{-3, -3}, {2, 2}};  ///< where patches may lie
  double fill = 0.6;                   ///< of the range that holds patches; and of the types, per patch
  int min_step = 1;
  int max_step = 5;  ///< every layer draws its own; equal to min_step: one step for all
  std::vector<LayerType> types{LayerType::occupancy(), LayerType::real("height", {"z"}),
                               LayerType::real("hits", {"n"}, Policy::kSum),
                               LayerType::semantic("semantic", {"road", "marking", "blocked"})};
};

namespace detail {

/// One cell with data. Masses are multiples of 1/256, so that sums are exact; some are certain.
inline void fill_cell(const LayerType& type, Random& random, bool wall, Layer& layer, CellIndex at) {
  if (!type.is_evidence()) {
    for (int c = 0; c < layer.channels(); ++c) {
      layer.at(c, at) =
          static_cast<float>(type.policy == Policy::kSum ? random.in(1, 20) : random.in(-400, 400) / 16.0);
    }
    return;
  }
  const int classes = static_cast<int>(type.hypotheses.size());
  int rest = 256;
  const int first = type.is_occupancy() ? (wall ? 0 : 1) : random.below(classes);
  const int most = random.chance(0.05) ? 256 : random.in(64, 250);
  for (int k = 0; k < classes; ++k) {
    const int mass = k == first ? most : random.below(std::min(rest, 257 - most) + 1) / 2;
    layer.at(k, at) = static_cast<float>(std::min(mass, rest)) / 256.0f;
    rest -= std::min(mass, rest);
  }
  if (type.stores_omega()) layer.at(classes, at) = static_cast<float>(rest) / 256.0f;
}

/// Rooms: free rectangles with occupied rims; the rest unknown.
inline void fill_layer(const LayerType& type, Random& random, Layer& layer) {
  const int side = layer.side();
  for (int rooms = random.in(1, 3); rooms > 0; --rooms) {
    const int a0 = random.below(side), a1 = random.in(a0, side - 1);
    const int b0 = random.below(side), b1 = random.in(b0, side - 1);
    for (int b = b0; b <= b1; ++b) {
      for (int a = a0; a <= a1; ++a) {
        const bool rim = a == a0 || a == a1 || b == b0 || b == b1;
        if (random.chance(0.9)) fill_cell(type, random, rim, layer, {a, b});
      }
    }
  }
}

}  // namespace detail

/// A map of rooms with unknown space between, the same for the same seed and options. Without vacuous layers.
inline Map random_map(std::uint64_t seed, const RandomMapOptions& options = {}) {
  Random random(seed);
  MapHeader header;
  header.frame = options.frame;
  header.types = TypeTable(options.types);
  Map map(std::move(header));
  for (int y = options.range.min.y; y <= options.range.max.y; ++y) {
    for (int x = options.range.min.x; x <= options.range.max.x; ++x) {
      if (!random.chance(options.fill)) continue;
      for (std::size_t t = 0; t < map.header().types.size(); ++t) {
        if (!random.chance(options.fill)) continue;
        const auto id = static_cast<TypeId>(t);
        Layer& layer = map.layer({x, y}, id, random.in(options.min_step, options.max_step));
        layer.stamp_ns = random.in(0, 1'000'000);
        detail::fill_layer(map.header().types[id], random, layer);
      }
    }
  }
  map.prune();
  return map;
}

/// What differs between the cells of two maps; empty if nothing does. Stamps count with `stamps`.
inline std::string difference(const Map& a, const Map& b, bool stamps = false) {
  if (a.header().types.size() != b.header().types.size()) return "numbers of types differ";
  if (a.size() != b.size()) {
    return "numbers of patches differ: " + std::to_string(a.size()) + " and " + std::to_string(b.size());
  }
  for (const auto& [key, patch] : a.by_key()) {
    const std::string where =
        "patch (" + std::to_string(patch.index.x) + "," + std::to_string(patch.index.y) + ")";
    const Patch* other = b.find(patch.index);
    if (other == nullptr) return where + " is missing";
    if (other->layers.size() != patch.layers.size()) return where + ": numbers of layers differ";
    for (const auto& [type, layer] : patch.layers) {
      const Layer* twin = b.find(patch.index, type);
      const std::string what = where + " layer '" + a.header().types[type].name + "'";
      if (twin == nullptr) return what + " is missing";
      if (twin->step() != layer.step()) return what + ": steps differ";
      if (!same_cells(layer, *twin)) return what + ": cells differ";
      if (stamps && twin->stamp_ns != layer.stamp_ns) return what + ": stamps differ";
    }
  }
  return {};
}

}  // namespace apgm::test
