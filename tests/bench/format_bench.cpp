// Writing, reading and verifying the town of make-bench-maps with 10 M known cells beside memcpy of its
// planes and XXH3 of its file, on one core: each figure is a median of ratios, the work and its peer timed in
// turn in one loop, in CPU time of the thread. The planes (some 140 MB) exceed any last-level cache; all
// memory has been touched before.
#include <benchmark/benchmark.h>
#include <unistd.h>
#include <xxhash.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "apgm/core/map.hpp"
#include "apgm/format/reader.hpp"
#include "apgm/format/verify.hpp"
#include "apgm/format/writer.hpp"
#include "tests/bench/city.hpp"
#include "tests/bench/pairs.hpp"
#include "tests/bench/parcels.hpp"

namespace {

using namespace apgm;
using bench::in_turn;
using bench::Model;

/// The layers of a town, its file, and memory for a copy of its layers.
struct Town {
  explicit Town(Model model) : city({.known_cells = 10'000'000, .seed = 1, .model = model, .overlap = 1}) {
    PatchInfo patch;
    for (const auto cursor = city.patches(); cursor->next(patch);) {
      Parcel& parcel = parcels.emplace_back();
      parcel.patch = patch.patch;
      city.load(patch.layers[0], parcel.cells);
      copies.push_back(parcel.cells);
    }
    Writer writer(file, city.header());
    write(writer);
  }

  /// Through all of the writer, with one StoredLayer for all layers.
  void write(Writer& writer) { bench::write_parcels(writer, parcels, stored); }

  void copy_planes() {
    for (std::size_t i = 0; i < parcels.size(); ++i) {
      std::memcpy(copies[i].plane(0).data(), parcels[i].cells.plane(0).data(), copies[i].value_bytes());
    }
  }

  static Town& of(Model model) {
    static std::unique_ptr<Town> towns[2];
    auto& town = towns[model == Model::kStepped];
    if (town == nullptr) town = std::make_unique<Town>(model);
    return *town;
  }

  bench::City city;
  std::vector<Parcel> parcels;
  std::vector<Layer> copies;
  std::vector<std::byte> file;
  StoredLayer stored;
};

/// Layers to StoredLayers: checks, content hashes, encoding.
void Encode(benchmark::State& state, Model model) {
  Town& town = Town::of(model);
  std::vector<std::byte> none;
  const Writer writer(none, town.city.header());
  in_turn(
      state, "memcpy",
      [&] {
        for (Parcel& parcel : town.parcels) {
          parcel.state = Parcel::State::kCells;
          parcel.stored = std::move(town.stored);
          writer.pack(parcel);
          town.stored = std::move(parcel.stored);
        }
      },
      [&] { town.copy_planes(); });
}
BENCHMARK_CAPTURE(Encode, continuous, Model::kContinuous)->UseManualTime()->Iterations(10);
BENCHMARK_CAPTURE(Encode, stepped, Model::kStepped)->UseManualTime()->Iterations(10);

/// Layers to a whole file in memory.
void WriteMemory(benchmark::State& state, Model model) {
  Town& town = Town::of(model);
  in_turn(
      state, "memcpy",
      [&] {
        town.file.clear();
        Writer writer(town.file, town.city.header());
        town.write(writer);
      },
      [&] { town.copy_planes(); });
}
BENCHMARK_CAPTURE(WriteMemory, continuous, Model::kContinuous)->UseManualTime()->Iterations(10);
BENCHMARK_CAPTURE(WriteMemory, stepped, Model::kStepped)->UseManualTime()->Iterations(10);

/// The same into the page cache: a file of the working directory that is replaced, not flushed.
void WriteFile(benchmark::State& state, Model model) {
  Town& town = Town::of(model);
  const std::string path = "format-bench-" + std::to_string(::getpid()) + ".apgm";
  in_turn(
      state, "memcpy",
      [&] {
        WriterOptions options;
        options.output.overwrite = true;
        options.output.fsync = false;
        Writer writer(path, town.city.header(), options);
        town.write(writer);
      },
      [&] { town.copy_planes(); });
  std::filesystem::remove(path);
}
BENCHMARK_CAPTURE(WriteFile, continuous, Model::kContinuous)->UseManualTime()->Iterations(10);
BENCHMARK_CAPTURE(WriteFile, stepped, Model::kStepped)->UseManualTime()->Iterations(10);

/// A file to decoded layers, opening and all checks included.
void Read(benchmark::State& state, Model model) {
  Town& town = Town::of(model);
  in_turn(
      state, "memcpy",
      [&] {
        const Reader reader(town.file);
        PatchInfo patch;
        std::size_t i = 0;
        for (const auto cursor = reader.patches(); cursor->next(patch);) {
          reader.load(patch.layers[0], town.copies[i++]);
        }
      },
      [&] { town.copy_planes(); });
}
BENCHMARK_CAPTURE(Read, continuous, Model::kContinuous)->UseManualTime()->Iterations(20);
BENCHMARK_CAPTURE(Read, stepped, Model::kStepped)->UseManualTime()->Iterations(20);

/// `count` layers of 2^step x 2^step cells, each with a few values.
std::vector<std::byte> many_small_layers(int count, int step) {
  std::mt19937_64 random(3);
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  Map map(header);
  const int side = static_cast<int>(std::sqrt(count)) + 1;
  for (int i = 0; i < count; ++i) {
    Layer& layer = map.layer({i % side - side / 2, i / side - side / 2}, 0, step);
    for (int k = 0; k < 4; ++k) {
      layer.plane(0)[random() % layer.cells()] = static_cast<float>(random() >> 40) * 0x1p-24f;
    }
  }
  std::vector<std::byte> bytes;
  Writer writer(bytes, header);
  for (auto& [key, patch] : map.by_key()) {
    Parcel parcel;
    parcel.patch = patch.index;
    parcel.cells = patch.layers.begin()->second;
    writer.pack(parcel);
    writer.put(patch.index, std::span(&parcel, 1));
  }
  writer.finish();
  return bytes;
}

void Verify(benchmark::State& state, std::vector<std::byte> bytes) {
  VerifyOptions options;
  options.threads = 1;
  in_turn(
      state, "xxh3", [&] { benchmark::DoNotOptimize(verify(bytes, options).layers); },
      [&] { benchmark::DoNotOptimize(XXH3_64bits(bytes.data(), bytes.size())); });
  state.counters["bytes"] = static_cast<double>(bytes.size());
}
void VerifyTown(benchmark::State& state) { Verify(state, Town::of(Model::kContinuous).file); }
void VerifySmall(benchmark::State& state) {
  Verify(state, many_small_layers(100'000, static_cast<int>(state.range(0))));
}
BENCHMARK(VerifyTown)->UseManualTime()->Iterations(20);
BENCHMARK(VerifySmall)->DenseRange(2, 6, 2)->UseManualTime()->Iterations(60);

/// Opening a map of a million layers and walking its whole index, beside a memcpy of the index's entries.
void WalkIndex(benchmark::State& state) {
  constexpr int kLayers = 1'000'000;
  const std::vector<std::byte> bytes = many_small_layers(kLayers, 1);
  const std::vector<char> from(std::size_t{kLayers} * 64, 1);
  std::vector<char> to(from);
  in_turn(
      state, "memcpy",
      [&] {
        const Reader reader(bytes);
        PatchInfo patch;
        std::size_t layers = 0;
        for (const auto cursor = reader.patches(); cursor->next(patch);) layers += patch.layers.size();
        if (layers != kLayers) state.SkipWithError("layers are missing");
      },
      [&] { std::memcpy(to.data(), from.data(), from.size()); });
}
BENCHMARK(WalkIndex)->UseManualTime()->Iterations(20);

/// Opening alone.
void Open(benchmark::State& state) {
  const std::vector<std::byte> bytes = many_small_layers(1'000'000, 1);
  for (auto _ : state) {
    const Reader reader(bytes);
    benchmark::DoNotOptimize(reader.summary().patches);
  }
}
BENCHMARK(Open)->Unit(benchmark::kMicrosecond);

/// Keys of patches around the origin, as they stand in a map; items are keys.
void CurveKey(benchmark::State& state) {
  std::mt19937_64 random(5);
  std::vector<PatchIndex> patches(4096);
  for (PatchIndex& p : patches) {
    p = {static_cast<std::int32_t>(random() % 2001) - 1000,
         static_cast<std::int32_t>(random() % 2001) - 1000};
  }
  for (auto _ : state) {
    std::uint64_t sum = 0;
    for (const PatchIndex p : patches) sum += curve_key(p);
    benchmark::DoNotOptimize(sum);
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(patches.size()));
}
BENCHMARK(CurveKey);

}  // namespace

BENCHMARK_MAIN();
