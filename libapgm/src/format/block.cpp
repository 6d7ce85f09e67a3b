#include "block.hpp"

#include <algorithm>

#include "apgm/core/error.hpp"
#include "xxh3.hpp"

namespace apgm::format {
namespace {

constexpr std::size_t kHashedBytes = offsetof(BlockHeader, hash);
static_assert(kHashedBytes == 56);

void append(std::vector<std::byte>& out, Bytes bytes) { out.insert(out.end(), bytes.begin(), bytes.end()); }

bool all_zero(Bytes bytes) {
  return std::all_of(bytes.begin(), bytes.end(), [](std::byte b) { return b == std::byte{0}; });
}

[[noreturn]] void fail(const char* what) { throw Error(ErrorCode::kDamaged, what); }

}  // namespace

std::uint64_t hash_of(Bytes bytes) { return XXH3_64bits(bytes.data(), bytes.size()); }

BlockHeader append_block(std::vector<std::byte>& out, Kind kind, std::uint64_t key, Bytes meta, Bytes body,
                         std::uint64_t commit, std::uint64_t context) {
  const std::size_t start = out.size();
  BlockHeader header;
  header.kind = kind;
  header.key = key;
  header.commit = commit;
  header.context = context;
  header.meta_bytes = static_cast<std::uint32_t>(padded(meta.size()));
  header.payload_bytes = header.meta_bytes + body.size();
  out.resize(start + sizeof(BlockHeader));
  append(out, meta);
  out.resize(start + sizeof(BlockHeader) + header.meta_bytes);
  append(out, body);
  header.payload_hash = hash_of(Bytes(out).subspan(start + sizeof(BlockHeader)));
  header.hash = hash_of(bytes_of(header).first(kHashedBytes));
  std::memcpy(out.data() + start, &header, sizeof(header));
  out.resize(start + sizeof(BlockHeader) + padded(header.payload_bytes));
  return header;
}

void restamp(std::span<std::byte> block, std::uint64_t commit, std::uint64_t context) {
  auto header = read_as<BlockHeader>(block);
  header.commit = commit;
  header.context = context;
  header.hash = hash_of(bytes_of(header).first(kHashedBytes));
  std::memcpy(block.data(), &header, sizeof(header));
}

void renumber_block(std::span<std::byte> block, std::uint64_t commit) {
  auto header = read_as<BlockHeader>(block);
  header.commit = commit;
  header.hash = hash_of(bytes_of(header).first(kHashedBytes));
  std::memcpy(block.data(), &header, sizeof(header));
}

bool is_block_header(Bytes bytes) {
  const auto h = read_as<BlockHeader>(bytes);
  return h.sync == kSync && h.hash == hash_of(bytes.first(kHashedBytes));
}

Block check_block(Bytes bytes) {
  if (bytes.size() < sizeof(BlockHeader)) fail("a block is cut short");
  Block block;
  block.header = read_as<BlockHeader>(bytes);
  const BlockHeader& h = block.header;
  if (h.sync != kSync) fail("a block does not start with its sync mark");
  if (h.hash != hash_of(bytes.first(kHashedBytes))) fail("a block header fails its checksum");
  if (h.version != 1 || h.flags > 1) {
    throw Error(ErrorCode::kUnsupported,
                "a block has version " + std::to_string(h.version) + " of its layout")
        .hint("a newer version of apgm can read it");
  }
  if (h.payload_bytes > bytes.size() || padded(h.payload_bytes) != bytes.size() - sizeof(BlockHeader) ||
      h.meta_bytes > h.payload_bytes || h.meta_bytes % 8 != 0) {
    fail("a block's sizes do not fit together");
  }
  const Bytes payload = bytes.subspan(sizeof(BlockHeader), h.payload_bytes);
  if (h.payload_hash != hash_of(payload)) fail("a block fails its checksum");
  if (!all_zero(bytes.subspan(sizeof(BlockHeader) + h.payload_bytes))) fail("a block's padding is not zero");
  block.meta = payload.first(h.meta_bytes);
  block.body = payload.subspan(h.meta_bytes);
  return block;
}

Block parse_block(Bytes bytes, Kind kind) {
  const Block block = check_block(bytes);
  if (block.header.kind != kind) fail("a block is of another kind than the index says");
  if (block.header.context != 0) fail("a block header holds reserved values");
  return block;
}

}  // namespace apgm::format
