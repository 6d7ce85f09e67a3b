#pragma once

#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "parts.hpp"
#include "tests/format/stream_support.hpp"

namespace apgm::test {

enum : std::uint8_t { kGone = 6, kPart = 7, kEnd = 8 };

using Texts = std::vector<std::string>;

/// Blocks of a stream that is written by `work`; the preamble is the first.
inline Texts sent(const MapHeader& header, const std::function<void(StreamWriter&)>& work,
                  const StreamOptions& options = {}) {
  Texts blocks;
  StreamWriter writer(
      [&](std::span<const std::byte> bytes) {
        blocks.emplace_back(reinterpret_cast<const char*>(bytes.data()), bytes.size());
      },
      header, options);
  work(writer);
  return blocks;
}

inline Texts sent_map(const Map& map, const StreamOptions& options = {}) {
  return sent(
      map.header(),
      [&](StreamWriter& writer) {
        send(map, writer);
        writer.finish();
      },
      options);
}

inline std::string joined(const Texts& blocks) {
  std::string bytes;
  for (const std::string& block : blocks) bytes += block;
  return bytes;
}

/// Patches (0,0) to (n-1,0) with a layer of occupancy each, the first with a height, too.
inline Map small_row(int n = 4, float mass = 0.5f, int step = 1) {
  Map map = row_of_patches(n, mass);
  if (step != 2) {
    Map other(map.header());
    for (int x = 0; x < n; ++x) {
      Layer& layer = other.layer({x, 0}, *map.header().types.find("occupancy"), step);
      for (std::size_t i = 0; i < layer.cells(); i += 2)
        layer.plane(1)[i] = mass * static_cast<float>(i + 1) / static_cast<float>(layer.cells());
    }
    map = other;
  }
  if (n > 0) map.layer({0, 0}, *map.header().types.find("height"), 0).plane(0)[0] = 1.5f;
  return map;
}

inline BlockHead head_of(const std::string& block) {
  BlockHead head;
  std::memcpy(&head, block.data(), sizeof(head));
  return head;
}

/// The block with head and payload changed, under right hashes.
inline std::string edited(const std::string& block,
                          const std::function<void(BlockHead&, std::string& payload)>& change) {
  BlockHead head = head_of(block);
  std::string payload = block.substr(sizeof(head), head.p);
  change(head, payload);
  return make_block(head, payload);
}

/// A block of its own under the map header of `like`.
inline std::string block_like(const std::string& like, std::uint8_t kind, std::uint64_t number,
                              const std::string& payload) {
  BlockHead head;
  head.kind = kind;
  head.commit = number;
  head.reserved = head_of(like).reserved;
  return make_block(head, payload);
}

/// Blocks from `first` on get numbers that are greater by `more`.
inline void renumber(Texts& blocks, std::size_t first, std::uint64_t more) {
  for (std::size_t i = first; i < blocks.size(); ++i)
    blocks[i] = edited(blocks[i], [=](BlockHead& head, std::string&) { head.commit += more; });
}

}  // namespace apgm::test
