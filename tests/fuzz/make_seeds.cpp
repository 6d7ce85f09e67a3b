// Writes the seeds of fuzz targets that are made, not written: small files of each format, and parts of the
// conformance corpus.
//
//   make-fuzz-seeds CORPUS_DIR OUT_DIR

#include <array>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>

#include "apgm/format/message.hpp"
#include "codec.hpp"
#include "converters/common/converter.hpp"
#include "fuzz.hpp"
#include "index.hpp"
#include "loose_file.hpp"
#include "make_seeds.hpp"
#include "random_map.hpp"

namespace apgm::fuzz {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kMostBytes = 32 << 10;

std::string_view text_of_bytes(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// The parts of a file that have targets of their own.
void save_parts(const fs::path& out, const std::string& name, std::string_view file) {
  auto loose = LooseFile::parse(std::as_bytes(std::span(file)));
  if (!loose) return;
  for (const auto& block : loose->blocks()) {
    const std::string_view payload = text_of_bytes(block.payload);
    if (block.header.kind == format::Kind::kMapHeader) save_seed(out / "map_header" / name, payload);
    if (block.header.kind == format::Kind::kIndexRoot)
      save_seed(out / "index" / (name + "-root"), std::string("\0", 1) + std::string(payload));
    if (!block.entries.empty()) {
      save_seed(out / "index" / (name + "-page"),
                "\1" + std::string(text_of_bytes(std::as_bytes(std::span(block.entries)))));
    }
  }
}

void save_corpus(const fs::path& corpus, const fs::path& out) {
  for (const auto& entry : fs::recursive_directory_iterator(corpus)) {
    if (entry.path().extension() != ".apgm" || entry.file_size() > kMostBytes) continue;
    const std::string bytes = test::read_file(entry.path().string());
    const std::string name = entry.path().stem().string();
    save_seed(out / "reader" / name, bytes);
    if (entry.path().parent_path().filename() == "good") save_parts(out, name, bytes);
  }
}

void save_messages(const fs::path& out) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    test::RandomMapOptions options;
    options.range = {{-1, -1}, {1, 0}};
    options.max_step = 3;
    const Map map = test::random_map(seed, options);
    save_seed(out / "message" / ("map-" + std::to_string(seed)), text_of_bytes(to_bytes(map)));
    const MapChanges changes{map, {{{5, 5}, "occupancy"}, {{6, 5}, "height"}}};
    save_seed(out / "message" / ("changes-" + std::to_string(seed)), text_of_bytes(to_bytes(changes)));
  }
}

/// Layers of each encoding, as fuzz_layer.cpp takes them.
void save_layers(const fs::path& out) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const Map map =
        test::random_map(seed, {.frame = {}, .range = {{0, 0}, {1, 1}}, .min_step = 0, .max_step = 6});
    for (const auto& [key, patch] : map.by_key()) {
      for (const auto& [type, layer] : patch.layers) {
        const std::string& name = map.header().types[type].name;
        const char number = name == "occupancy" ? 0 : name == "semantic" ? 1 : 3;
        if (name == "height") continue;
        for (const Lossy lossy : {Lossy::kNone, Lossy::kU16, Lossy::kU8}) {
          Layer cells = layer;
          format::quantise(cells, map.header().types[type], lossy);
          StoredLayer stored;
          format::encode(cells, map.header().types[type], 3, lossy, stored);
          std::string bytes{static_cast<char>(stored.encoding), static_cast<char>(stored.step), number};
          bytes += text_of_bytes(stored.bytes);
          save_seed(out / "layer" /
                        (std::to_string(stored.encoding) + "-" + std::to_string(seed) + "-" +
                         std::to_string(key % 1000) + name),
                    bytes);
        }
      }
    }
  }
}

std::string written(const converters::Converter& converter, const Map& map, const std::string& name,
                    const converters::Settings& settings = {}) {
  converters::WriteRequest request;
  request.path = directory() / name;
  request.settings = settings;
  request.output.overwrite = true;
  converter.write(map, request);
  return test::read_file(request.path);
}

void save_foreign(const fs::path& out) {
  const std::array<converters::Settings, 3> layouts{
      converters::Settings{{"layout", "quadtree"}},
      {{"layout", "dense_array"}},
      {{"layout", "moving"}, {"cell_m", "1.6"}, {"half_extent_m", "12.8"}}};
  const auto find = [](const char* name) { return converters::find(name); };
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    test::RandomMapOptions options{
        .frame = {}, .range = {{0, 0}, {1, 0}}, .fill = 1, .min_step = 3, .max_step = 3};
    options.types = {LayerType::occupancy()};
    const Map map = test::random_map(seed, options);
    const std::string n = std::to_string(seed);
    if (const auto* octomap = find("octomap")) {
      save_seed(out / "octomap" / (n + ".bt"), written(*octomap, map, "a.bt"));
      save_seed(out / "octomap" / (n + ".ot"), written(*octomap, map, "a.ot"));
    }
    if (const auto* map_server = find("map_server")) {
      const std::string yaml = written(*map_server, map, "a.yaml");
      const std::string picture = fs::exists(directory() / "a.pgm") ? "a.pgm" : "a.png";
      save_seed(out / "map_server" / n, yaml + "====\n" + test::read_file(directory() / picture));
    }
    if (const auto* geotiff = find("geotiff"))
      save_seed(out / "geotiff" / n, written(*geotiff, map, "a.tif"));
    if (const auto* numpy = find("numpy")) {
      save_seed(out / "numpy_npz" / n, written(*numpy, map, "a.npz"));
      const std::string array = written(*numpy, map, "a.npy");
      save_seed(out / "numpy_npy" / n, array + "====\n" + test::read_file(directory() / "a.json"));
    }
    if (const auto* fixed_grid = find("fixed_grid"))
      save_seed(out / "fixed_grid" / n, written(*fixed_grid, map, "a.apfg", layouts[seed % 3]));
  }
}

}  // namespace

void save_seed(const fs::path& path, std::string_view bytes) {
  fs::create_directories(path.parent_path());
  test::write_file(path.string(), std::string(bytes));
}

}  // namespace apgm::fuzz

int main(int argc, char** argv) {
  using namespace apgm::fuzz;
  if (argc != 3) return 2;
  try {
    save_corpus(argv[1], argv[2]);
    save_messages(argv[2]);
    save_layers(argv[2]);
    save_archives(argv[2]);
    save_streams(argv[2]);
    save_foreign(argv[2]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "make-fuzz-seeds: %s\n", error.what());
    return 1;
  }
  return 0;
}
