#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <type_traits>
#include <vector>

namespace apgm::format {

static_assert(std::endian::native == std::endian::little, "the structs below are little-endian as stored");

using Bytes = std::span<const std::byte>;

inline constexpr std::array<unsigned char, 8> kMagic{0x89, 'A', 'P', 'G', 'M', 0x0d, 0x0a, 0x1a};
inline constexpr std::array<char, 8> kSync{'A', 'P', 'G', 'M', 'B', 'L', 'K', '1'};
inline constexpr std::array<char, 8> kTail{'A', 'P', 'G', 'M', 'E', 'N', 'D', '1'};
inline constexpr std::uint16_t kMajor = 1;
inline constexpr std::uint16_t kMinor = 0;         ///< of sealed files
inline constexpr std::uint16_t kMinorArchive = 1;  ///< of archives
/// Bit of `incompat`: a stream of blocks without index and footer (docs/format.md, "Streams").
inline constexpr std::uint32_t kStreamBit = 1;

enum class Kind : std::uint8_t {
  kMapHeader = 1,
  kLayer = 2,
  kIndexPage = 3,
  kIndexRoot = 4,
  kFooter = 5,
  kGone = 6,  // this and the following: in streams only
  kPart = 7,
  kEnd = 8,
};

/// First 64 bytes of a file (docs/format.md, "Preamble").
struct Preamble {
  std::array<unsigned char, 8> magic = kMagic;
  std::uint16_t major = kMajor;
  std::uint16_t minor = kMinor;
  std::uint32_t incompat = 0;
  std::uint32_t ro_compat = 0;
  std::uint32_t compat = 0;
  std::array<std::uint64_t, 4> reserved{};
  std::uint64_t hash = 0;  ///< XXH3-64 of the 56 bytes before
};
static_assert(sizeof(Preamble) == 64 && std::is_trivially_copyable_v<Preamble>);

/// Head of every block (docs/format.md, "Blocks").
struct BlockHeader {
  std::array<char, 8> sync = kSync;
  Kind kind = Kind::kLayer;
  std::uint8_t flags = 0;
  std::uint16_t version = 1;
  std::uint32_t meta_bytes = 0;     ///< of the FlatBuffer at the payload's start, a multiple of 8
  std::uint64_t payload_bytes = 0;  ///< without the padding to 8 that follows
  std::uint64_t key = 0;
  std::uint64_t commit = 1;
  std::uint64_t payload_hash = 0;  ///< XXH3-64
  std::uint64_t context = 0;       ///< in a stream the payload hash of the MapHeader; else 0
  std::uint64_t hash = 0;          ///< XXH3-64 of the 56 bytes before
};
static_assert(sizeof(BlockHeader) == 64 && std::is_trivially_copyable_v<BlockHeader>);

/// Payload of the Footer block, which ends the file.
struct Footer {
  std::uint64_t header_offset = 0;
  std::uint64_t header_bytes = 0;
  std::uint64_t header_hash = 0;
  std::uint64_t root_offset = 0;
  std::uint64_t root_bytes = 0;
  std::uint64_t root_hash = 0;
  std::uint64_t patches = 0;
  std::uint64_t layers = 0;
  std::array<std::byte, 16> content_id{};
  std::int32_t x_min = 0, y_min = 0, x_max = -1, y_max = -1;
  std::uint64_t file_bytes = 0;
  std::uint64_t previous_footer = 0;
  std::uint64_t commits = 1;
  std::array<std::uint64_t, 8> reserved{};
  std::array<char, 8> tail = kTail;
};
static_assert(sizeof(Footer) == 192 && std::is_trivially_copyable_v<Footer>);
inline constexpr std::uint64_t kFooterBlockBytes = sizeof(BlockHeader) + sizeof(Footer);

/// One layer in an index page.
struct IndexEntry {
  std::uint64_t key = 0;
  std::uint64_t offset = 0;
  std::uint64_t content_hash = 0;
  std::uint64_t stored_hash = 0;
  std::int64_t stamp_ns = 0;
  std::int32_t ix = 0;
  std::int32_t iy = 0;
  std::uint32_t stored_bytes = 0;  ///< of the whole block with padding
  std::uint16_t type = 0;
  std::uint8_t step = 0;
  std::uint8_t encoding = 0;
  std::uint64_t reserved = 0;
};
static_assert(sizeof(IndexEntry) == 64 && std::is_trivially_copyable_v<IndexEntry>);

std::uint64_t hash_of(Bytes bytes);

template <typename T>
Bytes bytes_of(const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  return std::as_bytes(std::span<const T, 1>(&value, 1));
}

/// A trivially copyable T from the start of `bytes`, which must hold it.
template <typename T>
T read_as(Bytes bytes) {
  static_assert(std::is_trivially_copyable_v<T>);
  T value;
  std::memcpy(&value, bytes.data(), sizeof(T));
  return value;
}

constexpr std::uint64_t padded(std::uint64_t bytes) { return (bytes + 7) / 8 * 8; }

/// Makes a block of `meta` (its size is padded to 8 here) and `body` at the end of `out`. Returns the header.
BlockHeader append_block(std::vector<std::byte>& out, Kind kind, std::uint64_t key, Bytes meta, Bytes body,
                         std::uint64_t commit = 1, std::uint64_t context = 0);

/// Gives a whole block another commit and context.
void restamp(std::span<std::byte> block, std::uint64_t commit, std::uint64_t context);

/// Makes a whole block one of another commit.
void renumber_block(std::span<std::byte> block, std::uint64_t commit);

/// A block that passed its checks.
struct Block {
  BlockHeader header;
  Bytes meta;
  Bytes body;
};

/// True if the 64 bytes are a block's header by their sync mark and hash.
bool is_block_header(Bytes bytes);

/// Takes a whole stored block of any kind apart. `bytes` is exactly header + payload + padding.
/// @throws Error{kDamaged} naming the rule that is broken, without path or offset; {kUnsupported}
Block check_block(Bytes bytes);
/// The same for a block of a file that is to be of `kind`.
Block parse_block(Bytes bytes, Kind kind);

}  // namespace apgm::format
