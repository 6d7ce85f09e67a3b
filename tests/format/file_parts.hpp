#pragma once

#include <span>
#include <string>
#include <vector>

#include "block.hpp"

namespace apgm::test {

/// Where a block of a file lies.
struct BlockAt {
  format::BlockHeader header;
  std::size_t offset = 0;
  std::size_t bytes = 0;  ///< with header and padding
};

/// The blocks of a whole file, from the front.
inline std::vector<BlockAt> blocks_of(const std::string& file) {
  std::vector<BlockAt> blocks;
  for (std::size_t at = sizeof(format::Preamble); at < file.size(); at += blocks.back().bytes) {
    const auto h = format::read_as<format::BlockHeader>(std::as_bytes(std::span(file)).subspan(at));
    blocks.push_back({h, at, sizeof(format::BlockHeader) + format::padded(h.payload_bytes)});
  }
  return blocks;
}

inline BlockAt first_of(const std::string& file, format::Kind kind) {
  for (const BlockAt& block : blocks_of(file)) {
    if (block.header.kind == kind) return block;
  }
  return {};
}

inline std::string flipped(std::string file, std::size_t byte, int bit = 0) {
  file[byte] = static_cast<char>(file[byte] ^ (1 << bit));
  return file;
}

inline std::string zeroed(std::string file, std::size_t from, std::size_t bytes) {
  return file.replace(from, bytes, bytes, '\0');
}

}  // namespace apgm::test
