#include <filesystem>

#include "apgm/format/archive.hpp"
#include "apgm/format/stream.hpp"
#include "make_seeds.hpp"
#include "random_map.hpp"

namespace apgm::fuzz {
namespace {

Map small_map(std::uint64_t seed) {
  test::RandomMapOptions options;
  options.range = {{-1, -1}, {1, 0}};
  options.max_step = 3;
  return test::random_map(seed, options);
}

/// All of a map into a sink.
void put_all(const Map& map, PatchSink& sink) {
  for (const auto& [key, patch] : map.by_key()) {
    std::vector<Parcel> parcels;
    for (const auto& [type, layer] : patch.layers) {
      Parcel& parcel = parcels.emplace_back();
      parcel.patch = patch.index;
      parcel.type = type;
      parcel.cells = layer;
      sink.pack(parcel);
    }
    sink.put(patch.index, parcels);
  }
}

}  // namespace

void save_archives(const std::filesystem::path& out) {
  for (int commits = 1; commits <= 3; ++commits) {
    const std::string path = directory() / ("archive-" + std::to_string(commits));
    for (int n = 1; n <= commits; ++n) {
      const Map map = small_map(static_cast<std::uint64_t>(commits));
      ArchiveWriter writer(path, {.create = true, .expected = {}, .level = 3});
      writer.begin(map.header(), {},
                   {.message = "commit " + std::to_string(n), .tags = {"t" + std::to_string(n)}});
      if (n == 1) put_all(map, writer);
      writer.finish();
    }
    tag_commit(path, "first", 1);
    save_seed(out / "archive" / std::to_string(commits), test::read_file(path));
  }
}

void save_streams(const std::filesystem::path& out) {
  for (const std::uint32_t mtu : {0u, 256u, 1400u}) {
    std::string bytes;
    const auto send = [&](std::span<const std::byte> block) {
      bytes.append(reinterpret_cast<const char*>(block.data()), block.size());
    };
    const Map map = small_map(mtu + 1);
    StreamOptions options;
    options.mtu_bytes = mtu;
    StreamWriter writer(send, map.header(), options);
    put_all(map, writer);
    writer.finish();
    writer.gone(std::vector<MapChanges::Gone>{{{0, 0}, "occupancy"}, {{1, 0}, "height"}});
    put_all(map, writer);
    writer.end({});
    save_seed(out / "stream" / std::to_string(mtu), bytes);
  }
}

}  // namespace apgm::fuzz
