#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "block.hpp"

namespace apgm::fuzz {

/// An .apgm file taken apart into its blocks, however wrong they are, to be changed and put together again:
/// with offsets, sizes and hashes that fit, so that what was changed is met behind the checksums.
class LooseFile {
 public:
  struct Block {
    format::BlockHeader header;
    std::vector<std::byte> payload;
    std::uint64_t old_offset = 0;  ///< in the file it came from
    /// Of an index page that could be unpacked; they replace what the payload holds.
    std::vector<format::IndexEntry> entries;
  };

  /// nullopt if there is not a single block.
  static std::optional<LooseFile> parse(format::Bytes file);

  std::vector<Block>& blocks() { return blocks_; }
  format::Preamble& preamble() { return preamble_; }
  /// Makes the content hash of a changed layer fit its cells, if they can be decoded.
  void rehash_cells(Block& layer) const;
  /// The file. What blocks say of others is made to fit, but for what the block `lies` says.
  std::vector<std::byte> link(const Block* lies = nullptr);

 private:
  struct Place {
    std::uint64_t offset = 0;
    std::uint64_t bytes = 0;
    const Block* block = nullptr;
  };
  void lay_out();
  void link_page(Block& page);
  void link_root(Block& root) const;
  void link_footer(Block& footer) const;
  const Place* place_of(std::uint64_t old_offset) const;

  format::Preamble preamble_;
  std::vector<Block> blocks_;
  std::map<std::uint64_t, Place> places_;  // by old offset
};

}  // namespace apgm::fuzz
