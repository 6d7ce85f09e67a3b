#include "scan.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <memory>
#include <new>

#include "xxh3.hpp"

namespace apgm::format {
namespace {

/// Fits the second level of cache, so that hashing does not wait for memory.
constexpr std::size_t kWindowBytes = 256 * 1024;
/// What is kept of the payload of a block that is larger than the window.
constexpr std::uint64_t kKeptMeta = 4096;
constexpr std::size_t kHeaderHashed = offsetof(BlockHeader, hash);

}  // namespace

BlockScan::BlockScan(const InputFile& file, std::uint64_t from, std::uint64_t to)
    : file_(file), at_(from), end_(to), second_looks_(to - from), buffer_(kWindowBytes) {}

/// `bytes` bytes at `offset`, at most the window, or what there is of them.
Bytes BlockScan::window(std::uint64_t offset, std::uint64_t bytes) {
  bytes = std::min({bytes, end_ - offset, std::uint64_t{kWindowBytes}});
  const bool inside = offset >= buffer_at_ && offset <= buffer_at_ + buffered_;
  if (!inside || offset + bytes > buffer_at_ + buffered_) {
    const std::size_t kept = inside ? static_cast<std::size_t>(buffer_at_ + buffered_ - offset) : 0;
    if (kept > 0) std::memmove(buffer_.data(), buffer_.data() + (offset - buffer_at_), kept);
    const std::uint64_t total = std::min<std::uint64_t>(kWindowBytes, end_ - offset);
    buffered_ = 0;  // should reading fail
    file_.read(offset + kept, std::span(buffer_).subspan(kept, static_cast<std::size_t>(total) - kept));
    buffer_at_ = offset;
    buffered_ = static_cast<std::size_t>(total);
  }
  return Bytes(buffer_).subspan(static_cast<std::size_t>(offset - buffer_at_), bytes);
}

/// A header whose own hash is right and whose block ends within the file. Leaves the window where it is.
bool BlockScan::header_at(std::uint64_t offset, BlockHeader& out) {
  if (offset > end_ || end_ - offset < sizeof(BlockHeader)) return false;
  std::array<std::byte, sizeof(BlockHeader)> bytes;
  if (offset >= buffer_at_ && offset + bytes.size() <= buffer_at_ + buffered_) {
    std::memcpy(bytes.data(), buffer_.data() + (offset - buffer_at_), bytes.size());
  } else {
    file_.read(offset, bytes);
  }
  if (!is_block_header(bytes)) return false;
  out = read_as<BlockHeader>(bytes);
  const std::uint64_t rest = end_ - offset - sizeof(BlockHeader);
  return out.payload_bytes <= rest && padded(out.payload_bytes) <= rest &&
         out.meta_bytes <= out.payload_bytes && out.meta_bytes % 8 == 0;
}

bool BlockScan::next(Spot& out) {
  if (at_ >= end_) return false;
  out = Spot{};
  out.offset = at_;
  window(at_, sizeof(BlockHeader));
  if (header_at(at_, out.header)) {
    out.bytes = sizeof(BlockHeader) + padded(out.header.payload_bytes);
    read_block(out);
    if (out.state == Spot::State::kBadPayload) skip_broken(out);
  } else {
    out.why = "there is no block";
    out.bytes = next_header(at_ + 1) - at_;
  }
  at_ += out.bytes;
  return true;
}

void BlockScan::read_block(Spot& spot) {
  const std::uint64_t payload = spot.header.payload_bytes;
  std::uint64_t hash = 0;
  Bytes padding;
  if (spot.bytes <= kWindowBytes) {
    const Bytes block = window(spot.offset, spot.bytes);
    spot.payload = block.subspan(sizeof(BlockHeader), payload);
    hash = hash_of(spot.payload);
    padding = block.subspan(sizeof(BlockHeader) + payload);
  } else {
    hash = long_payload_hash(spot);
    const std::uint64_t end = spot.offset + sizeof(BlockHeader) + payload;
    padding = window(end, spot.offset + spot.bytes - end);
  }
  const bool zero = std::ranges::all_of(padding, [](std::byte b) { return b == std::byte{0}; });
  if (hash != spot.header.payload_hash) {
    spot.state = Spot::State::kBadPayload;
    spot.payload = {};
    spot.why = "a block fails its checksum";
  } else if (!zero) {
    spot.state = Spot::State::kBadPadding;
    spot.why = "a block's padding is not zero";
  } else {
    spot.state = Spot::State::kWhole;
  }
}

/// In pieces, the payload's start kept.
std::uint64_t BlockScan::long_payload_hash(Spot& spot) {
  const std::unique_ptr<XXH3_state_t, XXH_errorcode (*)(XXH3_state_t*)> state(XXH3_createState(),
                                                                              &XXH3_freeState);
  if (state == nullptr) throw std::bad_alloc();
  XXH3_64bits_reset(state.get());
  std::uint64_t at = spot.offset + sizeof(BlockHeader);
  const std::uint64_t end = at + spot.header.payload_bytes;
  const Bytes head = window(at, std::min<std::uint64_t>(spot.header.meta_bytes, kKeptMeta));
  meta_.assign(head.begin(), head.end());
  while (at < end) {
    const Bytes piece = window(at, end - at);
    XXH3_64bits_update(state.get(), piece.data(), piece.size());
    at += piece.size();
  }
  if (spot.header.meta_bytes <= kKeptMeta) spot.payload = meta_;
  return XXH3_64bits_digest(state.get());
}

/// A payload was changed in place if a block or the end follows; else bytes were put in or cut out, and the
/// next block is looked for within it. That is a second look at the same bytes: of those there is a budget,
/// or headers in headers would cost time by the square.
void BlockScan::skip_broken(Spot& spot) {
  BlockHeader follower;
  const std::uint64_t next = spot.offset + spot.bytes;
  if (next == end_ || header_at(next, follower) || spot.bytes > second_looks_) return;
  second_looks_ -= spot.bytes;
  spot.bytes = next_header(spot.offset + sizeof(BlockHeader)) - spot.offset;
}

/// Where the next header is, or the end.
std::uint64_t BlockScan::next_header(std::uint64_t offset) {
  while (offset < end_ && end_ - offset >= sizeof(BlockHeader)) {
    window(offset, sizeof(BlockHeader));  // and all that is buffered behind
    const Bytes bytes =
        Bytes(buffer_).first(buffered_).subspan(static_cast<std::size_t>(offset - buffer_at_));
    const auto* start = reinterpret_cast<const char*>(bytes.data());
    const void* found = ::memmem(start, bytes.size(), kSync.data(), kSync.size());
    if (found == nullptr) {
      offset += bytes.size() - (kSync.size() - 1);
      continue;
    }
    offset += static_cast<std::uint64_t>(static_cast<const char*>(found) - start);
    BlockHeader header;
    if (header_at(offset, header)) return offset;
    ++offset;
  }
  return end_;
}

bool repair_bit(std::span<std::byte> bytes, std::uint64_t hash) {
  for (std::byte& b : bytes) {
    for (int bit = 0; bit < 8; ++bit) {
      b ^= std::byte{1} << bit;
      if (hash_of(bytes) == hash) return true;
      b ^= std::byte{1} << bit;
    }
  }
  return false;
}

bool repair_header(std::span<std::byte> bytes) {
  const std::span<std::byte> hashed = bytes.first(kHeaderHashed);
  const auto said = read_as<std::uint64_t>(bytes.subspan(kHeaderHashed));
  const std::uint64_t computed = hash_of(hashed);
  if (std::popcount(said ^ computed) == 1) {
    std::memcpy(bytes.data() + kHeaderHashed, &computed, sizeof(computed));
    return true;
  }
  return repair_bit(hashed, said);
}

PatchIndex patch_of_key(std::uint64_t key) {
  // The tables of docs/format.md, section 7, read backwards.
  static constexpr std::array<std::array<std::uint8_t, 4>, 4> kQuadrant{
      {{0, 1, 3, 2}, {0, 2, 3, 1}, {3, 1, 0, 2}, {3, 2, 0, 1}}};
  static constexpr std::array<std::array<std::uint8_t, 4>, 4> kNext{
      {{1, 0, 2, 0}, {0, 3, 1, 1}, {2, 2, 0, 3}, {3, 1, 3, 2}}};
  std::uint32_t x = 0, y = 0;
  unsigned state = 0;
  for (int digit = 31; digit >= 0; --digit) {
    const unsigned q = kQuadrant[state][(key >> (2 * digit)) & 3u];
    x = x << 1 | q >> 1;
    y = y << 1 | (q & 1u);
    state = kNext[state][q];
  }
  return {static_cast<std::int32_t>(x ^ 0x80000000u), static_cast<std::int32_t>(y ^ 0x80000000u)};
}

}  // namespace apgm::format
