// Fusing and resampling beside memcpy, reading, memset and adding, on one core: each figure is a median of
// ratios, the work and its peer timed in turn in one loop, in CPU time of the thread.
//
// Cold caches: before each timed run of the paper's loads, 96 MiB that belong to neither are read. The
// kernels out of cache walk in turn through sets of layers that exceed any last-level cache together. "fresh"
// makes a new map each time; the allocator may still hand out memory that has been touched before.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <random>
#include <vector>

#include "apgm/fuse/combine.hpp"
#include "apgm/fuse/map_fuser.hpp"
#include "apgm/fuse/resample.hpp"
#include "fuse/combine_kernels.hpp"
#include "fuse/simd.hpp"
#include "pairs.hpp"

namespace {

using namespace apgm;
using bench::median;
using bench::Pairs;
using bench::seconds;

void evict() {
  static const std::vector<char> other(std::size_t{96} << 20, 1);
  // Only read, so that no written line waits in the cache for the timed run to push it out.
  char sum = 0;
  for (std::size_t i = 0; i < other.size(); i += 64) sum = static_cast<char>(sum + other[i]);
  benchmark::DoNotOptimize(sum);
}

Layer random_layer(const LayerType& type, int step, std::mt19937_64& random) {
  Layer layer(type, step);
  std::uniform_real_distribution<float> unit(0, 1);
  for (std::size_t i = 0; i < layer.cells(); ++i) {
    if (random() % 4 == 0) continue;
    float left = 1;
    for (int c = 0; c < layer.channels(); ++c) {
      const bool last = type.stores_omega() && c + 1 == layer.channels();
      const float m = last ? left : left * unit(random);
      layer.plane(c)[i] = m;
      left -= m;
    }
  }
  return layer;
}

/// `patches` patches in a square, all with a layer of `type`.
Map random_map(const TypeTable& types, const LayerType& type, int step, int patches, unsigned seed) {
  std::mt19937_64 random(seed);
  MapHeader header;
  header.types = types;
  Map map(std::move(header));
  const int side = static_cast<int>(std::ceil(std::sqrt(patches)));
  for (int i = 0; i < patches; ++i) {
    map.layer({i % side - side / 2, i / side - side / 2}, *types.find(type.name), step) =
        random_layer(type, step, random);
  }
  return map;
}

std::size_t value_bytes(std::span<const Map* const> maps) {
  std::size_t bytes = 0;
  for (const Map* map : maps) {
    for (const auto& [key, patch] : map->by_key()) {
      for (const auto& [type, layer] : patch.layers) bytes += layer.value_bytes();
    }
  }
  return bytes;
}

/// The paper's loads (Sec. IV): 243k occupancy cells in each of two lidar grids while parking; 345k and 88k
/// semantic cells of a camera on the road.
struct Load {
  std::vector<Map> maps;

  static Load parking() {
    const LayerType occupancy = LayerType::occupancy();
    const TypeTable types({occupancy});
    Load load;
    for (unsigned i = 0; i < 2; ++i) load.maps.push_back(random_map(types, occupancy, 7, 15, i));
    return load;
  }
  static Load road() {
    const LayerType occupancy = LayerType::occupancy();
    const LayerType surface = LayerType::semantic("surface", {"Road", "Marking", "Blocked"});
    const TypeTable types({occupancy, surface});
    Load load;
    for (unsigned i = 0; i < 2; ++i) load.maps.push_back(random_map(types, occupancy, 6, 84, i));
    load.maps.push_back(random_map(types, surface, 6, 22, 2));
    return load;
  }
  std::vector<const Map*> pointers() const {
    std::vector<const Map*> out;
    for (const Map& map : maps) out.push_back(&map);
    return out;
  }
};

enum Memory { kFresh, kRecycled, kInPlace };

/// Through the whole framework: maps in, fused map out; beside a memcpy of the bytes of all inputs.
void FuseLoad(benchmark::State& state, Load (*make)(), Memory memory) {
  const Load load = make();
  const auto maps = load.pointers();
  const std::size_t bytes = value_bytes(maps);
  std::vector<char> from(bytes, 1), to(bytes, 2);
  MapFuser fuser;
  Map target(load.maps[0].header());
  Pairs pairs;
  for (auto _ : state) {
    if (memory == kInPlace) {
      for (const auto& [key, patch] : load.maps[0].by_key()) target.patch(patch.index).layers = patch.layers;
    }
    evict();
    const double work = seconds([&] {
      if (memory == kFresh) {
        const Map fused = fuse_maps(maps);
        benchmark::DoNotOptimize(fused.size());
      } else if (memory == kRecycled) {
        benchmark::DoNotOptimize(fuser.fuse(maps).size());
      } else {
        fuser.fuse_into(target, std::span(maps).subspan(1));
      }
      benchmark::ClobberMemory();
    });
    evict();
    const double peer = seconds([&] {
      std::memcpy(to.data(), from.data(), bytes);
      benchmark::ClobberMemory();
    });
    state.SetIterationTime(work);
    pairs.add(work, peer);
  }
  pairs.report(state, "memcpy");
}
BENCHMARK_CAPTURE(FuseLoad, parking_fresh, Load::parking, kFresh)->UseManualTime()->Iterations(40);
BENCHMARK_CAPTURE(FuseLoad, parking_recycled, Load::parking, kRecycled)->UseManualTime()->Iterations(40);
BENCHMARK_CAPTURE(FuseLoad, parking_in_place, Load::parking, kInPlace)->UseManualTime()->Iterations(40);
BENCHMARK_CAPTURE(FuseLoad, road_fresh, Load::road, kFresh)->UseManualTime()->Iterations(40);
BENCHMARK_CAPTURE(FuseLoad, road_recycled, Load::road, kRecycled)->UseManualTime()->Iterations(40);
BENCHMARK_CAPTURE(FuseLoad, road_in_place, Load::road, kInPlace)->UseManualTime()->Iterations(40);

/// A pass over layers that exceed the caches together, from `step` to `to`; beside a memcpy that reads and
/// writes as many bytes in sum, in as many pieces.
void Resample(benchmark::State& state, Policy policy, int step, int to) {
  const LayerType type = LayerType::occupancy("occupancy", policy);
  std::mt19937_64 random(7);
  const Layer sample = random_layer(type, step, random);
  Layer shape;
  resample(sample, type, to, shape);
  const std::size_t both = sample.value_bytes() + shape.value_bytes();
  const std::size_t count = (std::size_t{96} << 20) / both;
  const std::vector<Layer> in(count, sample);
  std::vector<Layer> out(count, shape);
  std::vector<char> from(count * both / 2, 1), copy(count * both / 2, 2);
  Pairs pairs;
  for (auto _ : state) {
    const double work = seconds([&] {
      for (std::size_t i = 0; i < count; ++i) resample(in[i], type, to, out[i]);
      benchmark::ClobberMemory();
    });
    const double peer = seconds([&] {
      for (std::size_t i = 0; i < count; ++i) {
        std::memcpy(&copy[i * both / 2], &from[i * both / 2], both / 2);
      }
      benchmark::ClobberMemory();
    });
    state.SetIterationTime(work);
    pairs.add(work, peer);
  }
  pairs.report(state, "memcpy");
}
BENCHMARK_CAPTURE(Resample, merge_conditional, Policy::kConditional, 7, 6)->UseManualTime()->Iterations(20);
BENCHMARK_CAPTURE(Resample, merge_exclusive, Policy::kExclusive, 7, 6)->UseManualTime()->Iterations(20);
BENCHMARK_CAPTURE(Resample, merge_min, Policy::kMin, 7, 6)->UseManualTime()->Iterations(20);
BENCHMARK_CAPTURE(Resample, merge_product, Policy::kProduct, 7, 6)->UseManualTime()->Iterations(20);
BENCHMARK_CAPTURE(Resample, split_conditional, Policy::kConditional, 6, 7)->UseManualTime()->Iterations(20);
BENCHMARK_CAPTURE(Resample, split_exclusive, Policy::kExclusive, 6, 7)->UseManualTime()->Iterations(20);
BENCHMARK_CAPTURE(Resample, split_product, Policy::kProduct, 6, 7)->UseManualTime()->Iterations(20);

/// Two layers fused at `step`, one of them `levels` finer (merged) or coarser (split): LayerFuser, which
/// makes strips, beside resampling whole layers first. Out of cache.
void View(benchmark::State& state, int levels) {
  const int step = static_cast<int>(state.range(0));
  const LayerType type = LayerType::occupancy();
  std::mt19937_64 random(8);
  const Layer sample = random_layer(type, step, random), other = random_layer(type, step + levels, random);
  const std::size_t count = (std::size_t{96} << 20) / (2 * sample.value_bytes() + other.value_bytes());
  const std::vector<Layer> a(count, sample), b(count, other);
  std::vector<Layer> out(count, sample);
  LayerFuser fuser;
  Layer resampled;
  Pairs pairs;
  for (auto _ : state) {
    const double work = seconds([&] {
      for (std::size_t i = 0; i < count; ++i) {
        fuser.fuse(std::array<FuseInput, 2>{{{&a[i], &type, 1.0f}, {&b[i], &type, 1.0f}}}, step,
                   Rule::kDempster, out[i]);
      }
      benchmark::ClobberMemory();
    });
    const double peer = seconds([&] {
      for (std::size_t i = 0; i < count; ++i) {
        resample(b[i], type, step, resampled);
        combine(std::array<const Layer*, 2>{&a[i], &resampled}, type, Rule::kDempster, out[i]);
      }
      benchmark::ClobberMemory();
    });
    state.SetIterationTime(work);
    pairs.add(work, peer);
  }
  pairs.report(state, "copy");
}
BENCHMARK_CAPTURE(View, merge_2x2, 1)->DenseRange(5, 9)->UseManualTime()->Iterations(24);
BENCHMARK_CAPTURE(View, merge_4x4, 2)->DenseRange(5, 9)->UseManualTime()->Iterations(24);
BENCHMARK_CAPTURE(View, split_4, -1)->DenseRange(5, 9)->UseManualTime()->Iterations(24);
BENCHMARK_CAPTURE(View, split_16, -2)->DenseRange(5, 9)->UseManualTime()->Iterations(24);

/// What reading takes: 64-bit sums need no order, so that the loop is vector code.
APGM_CLONES std::uint64_t read_all(const float* values, std::size_t n) {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < n; ++i) sum += std::bit_cast<std::uint32_t>(values[i]);
  return sum;
}

/// A merge 2x2 beside reading the same input, or a split into 4 beside a memset of the same output; out of
/// cache.
void Bandwidth(benchmark::State& state, Policy policy, int step, int to) {
  const LayerType type = LayerType::occupancy("occupancy", policy);
  std::mt19937_64 random(10);
  const Layer sample = random_layer(type, step, random);
  Layer shape;
  resample(sample, type, to, shape);
  const std::size_t count = (std::size_t{128} << 20) / (sample.value_bytes() + shape.value_bytes());
  const std::vector<Layer> in(count, sample);
  std::vector<Layer> out(count, shape), filled = out;
  const bool merges = to < step;
  Pairs pairs;
  for (auto _ : state) {
    const double work = seconds([&] {
      for (std::size_t i = 0; i < count; ++i) resample(in[i], type, to, out[i]);
      benchmark::ClobberMemory();
    });
    const double peer = seconds([&] {
      for (std::size_t i = 0; i < count; ++i) {
        if (merges) {
          benchmark::DoNotOptimize(read_all(in[i].plane(0).data(), 2 * in[i].cells()));
        } else {
          std::memset(filled[i].plane(0).data(), static_cast<int>(i & 1), filled[i].value_bytes());
        }
      }
      benchmark::ClobberMemory();
    });
    state.SetIterationTime(work);
    pairs.add(work, peer);
  }
  pairs.report(state, merges ? "read" : "memset");
}
BENCHMARK_CAPTURE(Bandwidth, merge_conditional, Policy::kConditional, 7, 6)->UseManualTime()->Iterations(20);
BENCHMARK_CAPTURE(Bandwidth, merge_exclusive, Policy::kExclusive, 7, 6)->UseManualTime()->Iterations(20);
BENCHMARK_CAPTURE(Bandwidth, split_conditional, Policy::kConditional, 6, 7)->UseManualTime()->Iterations(20);
BENCHMARK_CAPTURE(Bandwidth, split_exclusive, Policy::kExclusive, 6, 7)->UseManualTime()->Iterations(20);

/// What two planes take at least: reads two layers, writes one.
APGM_CLONES void add_planes(const float* a, const float* b, float* out, std::size_t n) {
  APGM_IVDEP
  for (std::size_t i = 0; i < n; ++i) out[i] = a[i] + b[i];
}

/// The same with the loads and stores of a cell together, in the order of the rule.
APGM_CLONES void add_cells(fuse::OccupancyPlanes a, fuse::OccupancyPlanes b, fuse::OccupancyOut out,
                           std::size_t n) {
  APGM_IVDEP
  for (std::size_t i = 0; i < n; ++i) {
    out.o[i] = a.o[i] + b.o[i];
    out.f[i] = a.f[i] + b.f[i];
  }
}

using Planes = fuse::OccupancyPlanes;
Planes planes(const Layer& layer) { return {layer.plane(0).data(), layer.plane(1).data()}; }

void library(const Layer& a, const Layer& b, const LayerType& type, Layer& out) {
  combine(std::array<const Layer*, 2>{&a, &b}, type, Rule::kDempster, out);
}

/// What is written first: cell by cell, divided by 1 - K. Errs by 5.6e-5 at high conflict.
#if defined(__GNUC__) && !defined(__clang__)
__attribute__((optimize("no-tree-vectorize")))
#endif
void scalar_loop(const Layer& a, const Layer& b, const LayerType&, Layer& out) {
  const Planes x = planes(a), y = planes(b);
  float *o = out.plane(0).data(), *f = out.plane(1).data();
  for (std::size_t i = 0; i < out.cells(); ++i) {
    const float k = x.o[i] * y.f[i] + x.f[i] * y.o[i];
    const float xu = 1.0f - x.o[i] - x.f[i], yu = 1.0f - y.o[i] - y.f[i];
    if (k >= 1.0f) {
      o[i] = f[i] = 0.0f;
      continue;
    }
    o[i] = (x.o[i] * y.o[i] + x.o[i] * yu + xu * y.o[i]) / (1.0f - k);
    f[i] = (x.f[i] * y.f[i] + x.f[i] * yu + xu * y.f[i]) / (1.0f - k);
  }
}

/// Dempster's rule beside plain additions of the same layers; range(0) pairs of them, walked in turn. `ratio`
/// is to an addition plane by plane, `cells_ratio` to one with the loads and stores of a cell together.
void Dempster(benchmark::State& state, int step,
              void (*rule)(const Layer&, const Layer&, const LayerType&, Layer&)) {
  const LayerType type = LayerType::occupancy();
  std::mt19937_64 random(9);
  const std::size_t count = static_cast<std::size_t>(state.range(0));
  const std::vector<Layer> a(count, random_layer(type, step, random)),
      b(count, random_layer(type, step, random));
  std::vector<Layer> out(count, Layer(type, step)), sum = out;
  const std::size_t passes = std::max<std::size_t>(1, (std::size_t{1} << 21) / (count * out[0].cells()));
  const auto walk = [&](auto&& work) {
    return seconds([&] {
      for (std::size_t p = 0; p < passes; ++p) {
        for (std::size_t i = 0; i < count; ++i) work(i);
      }
      benchmark::ClobberMemory();
    });
  };
  Pairs by_plane, by_cell;
  for (auto _ : state) {
    const double work = walk([&](std::size_t i) { rule(a[i], b[i], type, out[i]); });
    const double add = walk([&](std::size_t i) {
      for (int c = 0; c < 2; ++c) {
        add_planes(a[i].plane(c).data(), b[i].plane(c).data(), sum[i].plane(c).data(), sum[i].cells());
      }
    });
    const double cells = walk([&](std::size_t i) {
      add_cells(planes(a[i]), planes(b[i]), {sum[i].plane(0).data(), sum[i].plane(1).data()}, sum[i].cells());
    });
    state.SetIterationTime(work);
    by_plane.add(work, add);
    by_cell.add(work, cells);
  }
  by_cell.report(state, "cells");
  state.counters["cells_ratio"] = state.counters["ratio"];
  by_plane.report(state, "add");
  const auto done = static_cast<double>(passes * count * out[0].cells());
  state.counters["mcells_per_s"] = done / state.counters["work_us"];
}
BENCHMARK_CAPTURE(Dempster, in_l2, 6, library)->Arg(3)->UseManualTime()->Iterations(20);
// 0.25 M, 1 M and 10 M cells; 0.5 M are what the last-level cache holds beside the outputs of both.
BENCHMARK_CAPTURE(Dempster, library, 7, library)->Arg(16)->Arg(32)->Arg(64)->UseManualTime()->Iterations(30);
BENCHMARK_CAPTURE(Dempster, library, 7, library)->Arg(610)->UseManualTime()->Iterations(10);
BENCHMARK_CAPTURE(Dempster, scalar_loop, 7, scalar_loop)->Arg(16)->Arg(64)->UseManualTime()->Iterations(10);
BENCHMARK_CAPTURE(Dempster, scalar_loop, 7, scalar_loop)->Arg(610)->UseManualTime()->Iterations(5);

}  // namespace

BENCHMARK_MAIN();
