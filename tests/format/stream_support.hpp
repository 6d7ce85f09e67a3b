#pragma once

#include <cstring>
#include <string>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/format/content_id.hpp"
#include "apgm/format/stream.hpp"
#include "apgm/format/stream_map.hpp"
#include "random_map.hpp"
#include "sample_map.hpp"
#include "stream_blocks.hpp"
#include "temp_dir.hpp"

namespace apgm::test {

using Bytes = std::vector<std::byte>;
using Blocks = std::vector<Bytes>;

/// Blocks of a stream, one a call of the output; the first is the preamble.
struct Sent {
  Blocks blocks;
  StreamWriter::Output output() {
    return [this](std::span<const std::byte> block) { blocks.emplace_back(block.begin(), block.end()); };
  }
};

inline Blocks stream_of(const PatchSource& map, const StreamOptions& options = {}) {
  Sent sent;
  StreamWriter writer(sent.output(), map.header(), options);
  stream(map, writer);
  return sent.blocks;
}

/// The layers of `map`, without an end.
inline void send(const Map& map, StreamWriter& writer) {
  for (const auto& [key, patch] : map.by_key()) {
    for (const auto& [type, layer] : patch.layers) {
      Parcel parcel;
      parcel.patch = patch.index;
      parcel.type = type;
      parcel.stamp_ns = layer.stamp_ns;
      parcel.cells = layer;
      writer.pack(parcel);
      writer.put(patch.index, std::span(&parcel, 1));
    }
  }
}

inline Bytes joined(const Blocks& blocks) {
  Bytes bytes;
  for (const Bytes& b : blocks) bytes.insert(bytes.end(), b.begin(), b.end());
  return bytes;
}

inline format::BlockHeader head_of(const Bytes& block) { return format::read_as<format::BlockHeader>(block); }

/// One occupancy layer a patch, (0,0) to (n-1,0).
inline Map row_of_patches(int n, float mass = 0.5f) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy(), LayerType::real("height", {"z"})});
  Map map(header);
  for (int x = 0; x < n; ++x) map.layer({x, 0}, *header.types.find("occupancy"), 2).plane(0)[3] = mass;
  return map;
}

/// A map that takes what arrives.
struct Receiver {
  explicit Receiver(const StreamLimits& limits = {}) : reader(map, limits) {}
  StreamReport feed(const Bytes& bytes) {
    reader.feed(bytes);
    reader.finish();
    return reader.report();
  }
  StreamReport datagrams(const Blocks& blocks) {
    for (const Bytes& block : blocks) reader.datagram(block);
    return reader.report();
  }
  TempDir dir;
  StreamMap map{dir.path()};
  StreamReader reader;
};

/// All layers and cells of `map`, which may be in a file, in memory.
inline Map in_memory(const PatchSource& source) {
  Map map(source.header());
  MapSink sink(map);
  stream(source, sink);
  return map;
}

/// Notes what arrives, as text.
struct Log final : StreamHandler {
  void header(const MapHeader& h) override { lines.push_back("header " + std::to_string(h.types.size())); }
  void layer(const StreamLayer& l) override {
    decode(l, cells);
    lines.push_back("layer " + at(l.info.patch) + " " + l.header.types[l.info.type].name);
    numbers.push_back(l.number);
  }
  void gone(const StreamGone& g) override {
    lines.push_back("gone " + at(g.patch) + " " + g.header.types[g.type].name);
  }
  void end(const StreamEnd& e) override {
    lines.push_back("end " + std::to_string(e.layers) + " " + std::to_string(e.gone) + " missing " +
                    std::to_string(e.missing));
    last = {e.ids, e.whole};
  }
  static std::string at(PatchIndex p) { return std::to_string(p.x) + "," + std::to_string(p.y); }

  Layer cells;
  std::vector<std::string> lines;
  std::vector<std::uint64_t> numbers;
  std::pair<MessageEnd, bool> last;
};

/// What is said of `bytes`, all of which came through a pipe.
inline StreamReport report_of(std::span<const std::byte> bytes, StreamHandler& handler) {
  StreamReader reader(handler);
  reader.feed(bytes);
  reader.finish();
  return reader.report();
}

}  // namespace apgm::test
