#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "apgm/core/frame.hpp"
#include "block.hpp"
#include "input_file.hpp"

namespace apgm::format {

/// What stands at a place of a file.
struct Spot {
  enum class State : std::uint8_t {
    kWhole,       ///< a block; its hashes are right
    kBadPadding,  ///< a block, but for what follows its payload
    kBadPayload,  ///< a block's header, then other bytes than it says
    kNoBlock,     ///< bytes up to the next block's header, or the end
  };
  State state = State::kNoBlock;
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;  ///< up to the next spot
  BlockHeader header;       ///< not of kNoBlock
  /// The payload's start, of whole blocks: all of it if it is small, else the FlatBuffer unless that is
  /// larger than any layer's. Valid until the next spot.
  Bytes payload;
  const char* why = "";  ///< what is wrong, in words
};

/// Walks a file from the front, block by block, and hashes each while it is in the cache. Where a block is
/// not whole it goes on at the next header that is, at any byte: something may have been put in or cut out.
///
/// Guarantees: time linear in the size, whatever the bytes are; a fixed amount of memory; spots follow each
/// other without gaps.
class BlockScan {
 public:
  /// Of the bytes [from, to).
  BlockScan(const InputFile& file, std::uint64_t from, std::uint64_t to);
  /// False at the end. @throws Error{kUnreadable}
  bool next(Spot& out);

 private:
  Bytes window(std::uint64_t offset, std::uint64_t bytes);
  bool header_at(std::uint64_t offset, BlockHeader& out);
  void read_block(Spot& spot);
  std::uint64_t long_payload_hash(Spot& spot);
  void skip_broken(Spot& spot);
  std::uint64_t next_header(std::uint64_t offset);

  const InputFile& file_;
  std::uint64_t at_;
  std::uint64_t end_;
  std::uint64_t second_looks_;  // bytes that may still be looked at twice
  std::vector<std::byte> buffer_;
  std::vector<std::byte> meta_;  // of a block larger than the buffer
  std::uint64_t buffer_at_ = 0;
  std::size_t buffered_ = 0;
};

/// If one bit of `bytes` was flipped, flips it back: the bit for which they have the hash that was said of
/// them. Tries all bits, so the time grows with the square of the size.
/// @return  false, `bytes` unchanged, if there is no such bit
bool repair_bit(std::span<std::byte> bytes, std::uint64_t hash);

/// The same for the 64 bytes of a block's header, which may also be flipped in its own hash.
bool repair_header(std::span<std::byte> bytes);

/// The patch of a key.
PatchIndex patch_of_key(std::uint64_t key);

}  // namespace apgm::format
