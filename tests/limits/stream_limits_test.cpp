// Both sides of the limits of streams: docs/format.md, 10.2 and 10.5.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/format/stream_support.hpp"

namespace apgm {
namespace {

using namespace test;
using format::bytes_of;
using format::Kind;

/// What follows a header of two types, block by block.
struct Forge {
  Forge() {
    const Blocks blocks = stream_of(row_of_patches(1));
    header = blocks[1];
    layer = blocks[2];
    context = head_of(header).payload_hash;
  }
  Bytes block(Kind kind, std::span<const std::byte> body, std::uint64_t number) const {
    Bytes bytes;
    format::append_block(bytes, kind, 0, {}, body, number, context);
    return bytes;
  }
  Bytes layer_of(std::uint64_t number) const {
    Bytes bytes = layer;
    format::restamp(bytes, number, context);
    return bytes;
  }
  /// `n` layers, all of them there.
  Bytes gone(std::size_t n) const {
    std::vector<PatchIndex> patches;
    for (std::size_t i = 0; i < n; ++i) {
      patches.push_back({static_cast<std::int32_t>(i % 64), static_cast<std::int32_t>(i / 64)});
    }
    std::ranges::sort(patches, {}, curve_key);
    Bytes body;
    for (const PatchIndex patch : patches) {
      const format::GoneRecord record{patch.x, patch.y, 0, {}};
      const auto bytes = bytes_of(record);
      body.insert(body.end(), bytes.begin(), bytes.end());
    }
    return block(Kind::kGone, body, 2);
  }
  /// The first of two parts of a block of `whole` bytes.
  Bytes part(std::uint64_t whole, std::uint64_t number) const {
    const std::uint64_t piece = format::padded((whole + 1) / 2);
    const format::PartHead head{0, 2, whole};
    Bytes body(sizeof(head) + piece);
    std::memcpy(body.data(), &head, sizeof(head));
    return block(Kind::kPart, body, number);
  }
  StreamReport report(const Blocks& blocks) const {
    Log log;
    StreamReader reader(log);
    reader.datagram(header);
    for (const Bytes& bytes : blocks) reader.datagram(bytes);
    return reader.report();
  }

  Bytes header, layer;
  std::uint64_t context = 0;
};

TEST(StreamLimits, RecordsOfGone) {
  const Forge forge;
  const StreamReport most = forge.report({forge.gone(4096)});
  EXPECT_EQ(most.damaged, 0u) << most.fault;
  EXPECT_EQ(most.gone, 4096u);
  const StreamReport more = forge.report({forge.gone(4097)});
  EXPECT_EQ(more.damaged, 1u);
  EXPECT_EQ(more.gone, 0u);
  EXPECT_EQ(forge.report({forge.gone(1)}).gone, 1u);
  EXPECT_EQ(forge.report({forge.gone(0)}).damaged, 1u);
}

TEST(StreamLimits, BytesOfABlock) {
  const Forge forge;
  constexpr std::uint64_t kMost = std::uint64_t{72} << 20;
  EXPECT_EQ(forge.report({forge.part(kMost, 2)}).damaged, 0u);
  EXPECT_EQ(forge.report({forge.part(kMost + 8, 2)}).damaged, 1u);
}

TEST(StreamLimits, BytesThatAreKept) {
  const Forge forge;
  const auto incomplete = [&](std::uint64_t max_kept_bytes) {
    Log log;
    StreamReader reader(log, {.max_kept_bytes = max_kept_bytes});
    reader.datagram(forge.header);
    for (std::uint64_t number : {2, 10}) reader.datagram(forge.part(2000, number));
    // The other half of the first block, which is not sound: it was kept if it is looked at.
    const format::PartHead head{1, 2, 2000};
    Bytes body(sizeof(head) + 1000);
    std::memcpy(body.data(), &head, sizeof(head));
    reader.datagram(forge.block(Kind::kPart, body, 3));
    return reader.report().damaged == 0;
  };
  EXPECT_FALSE(incomplete(1 << 20));
  EXPECT_TRUE(incomplete(1200));
}

TEST(StreamLimits, BytesThatAreKeptByDefault) {
  constexpr std::uint64_t kMiB = std::uint64_t{1} << 20, kBlock = 72 * kMiB, kPiece = kBlock / 2;
  constexpr std::uint64_t kOverhead = 256;  // of each
  const Forge forge;
  const auto oldest_is_kept = [&](std::uint64_t last_piece) {
    Log log;
    StreamReader reader(log);
    reader.datagram(forge.header);
    for (std::uint64_t number : {2, 10, 20}) reader.datagram(forge.part(kBlock, number));
    reader.datagram(forge.part(2 * last_piece, 30));
    // The other half of the oldest, which does not fit it: it was kept if that is found wrong.
    const format::PartHead head{1, 2, kBlock};
    Bytes body(sizeof(head) + kPiece - 8);
    std::memcpy(body.data(), &head, sizeof(head));
    reader.datagram(forge.block(Kind::kPart, body, 3));
    return reader.report().damaged == 1;
  };
  constexpr std::uint64_t kMost = 128 * kMiB - 3 * (kPiece + kOverhead) - kOverhead;
  EXPECT_TRUE(oldest_is_kept(kMost));
  EXPECT_FALSE(oldest_is_kept(kMost + 8));
}

TEST(StreamLimits, Gaps) {
  const Forge forge;
  const auto with_gaps = [&](std::uint64_t n) {
    Log log;
    StreamReader reader(log);
    reader.datagram(forge.header);
    for (std::uint64_t i = 1; i <= n; ++i) reader.datagram(forge.layer_of(1 + 2 * i));
    reader.datagram(forge.layer_of(2));  // of the oldest gap
    return reader.report();
  };
  EXPECT_EQ(with_gaps(4096).late, 0u);
  EXPECT_EQ(with_gaps(4096).lost, 4095u);
  EXPECT_EQ(with_gaps(4097).late, 1u);
  EXPECT_EQ(with_gaps(4097).lost, 4097u);
}

TEST(StreamLimits, LayersThatAreRemembered) {
  const Forge forge;
  const auto with_layers = [&](std::uint64_t n) {
    Log log;
    StreamReader reader(log);
    reader.datagram(forge.header);
    // Number 2 is missing: as long as it is, the newest state of each layer is kept in mind.
    for (std::uint64_t i = 0; i < n; ++i) reader.datagram(forge.layer_of(3 + i));
    reader.datagram(forge.layer_of(2));
    return reader.report();
  };
  EXPECT_EQ(with_layers(65'536).superseded, 1u);
  EXPECT_EQ(with_layers(65'536).late, 0u);
  EXPECT_EQ(with_layers(65'537).late, 1u);
}

}  // namespace
}  // namespace apgm
