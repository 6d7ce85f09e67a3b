// Streams with right checksums that lie, and bytes that are no stream: what a stranger can send.

#include <gmock/gmock.h>

#include "stream_support.hpp"

namespace apgm {
namespace {

using namespace test;
using format::bytes_of;
using format::EndBody;
using format::GoneRecord;
using format::Kind;
using format::PartHead;

/// A stream that is made block by block.
struct Forge {
  Forge() {
    const Blocks blocks = stream_of(sample_map(1, 1, 1));
    header = blocks[1];
    context = head_of(header).payload_hash;
    for (const Bytes& block : blocks) {
      if (head_of(block).kind == Kind::kLayer) layer = block;
    }
  }
  Bytes block(Kind kind, std::span<const std::byte> body, std::uint64_t commit, std::uint64_t key = 0) const {
    Bytes bytes;
    format::append_block(bytes, kind, key, {}, body, commit, context);
    return bytes;
  }
  Bytes part(std::uint32_t index, std::uint32_t count, std::uint64_t bytes, std::size_t size,
             std::uint64_t commit) const {
    const PartHead head{index, count, bytes};
    Bytes body(sizeof(head) + size);
    std::memcpy(body.data(), &head, sizeof(head));
    return block(Kind::kPart, body, commit);
  }
  StreamReport report(const Blocks& blocks) const {
    Receiver receiver;
    receiver.reader.datagram(header);
    return receiver.datagrams(blocks);
  }

  Bytes header, layer;
  std::uint64_t context = 0;
};

/// The block with its header changed, under a right hash.
template <typename Change>
Bytes changed(Bytes block, Change change) {
  auto head = head_of(block);
  change(head);
  std::memcpy(block.data(), &head, sizeof(head));
  format::restamp(block, head.commit, head.context);
  return block;
}

TEST(StreamHostileTest, FieldsThatBreakARuleAreDamage) {
  const Forge forge;
  const auto is_damage = [&](const Bytes& block, const char* what) {
    const StreamReport report = forge.report({block});
    EXPECT_EQ(report.damaged, 1u) << what;
    EXPECT_EQ(report.layers + report.gone + report.messages, 0u) << what;
    EXPECT_FALSE(report.complete()) << what;
  };
  is_damage(changed(forge.layer, [](auto& h) { h.commit = 0; }), "no number");
  is_damage(changed(forge.layer, [](auto& h) { h.key ^= 1; }), "another key");
  is_damage(changed(forge.layer, [](auto& h) { h.payload_bytes = std::uint64_t{1} << 40; }), "a terabyte");
  is_damage(changed(forge.layer, [](auto& h) { h.payload_bytes = ~std::uint64_t{0}; }), "all bits");
  is_damage(changed(forge.layer, [](auto& h) { h.meta_bytes = ~0u; }), "a FlatBuffer beyond the payload");
  is_damage(changed(forge.layer, [](auto& h) { h.kind = Kind::kMapHeader; }), "a layer as a map header");
  is_damage(changed(forge.layer, [](auto& h) { h.kind = Kind::kGone; }), "a layer as a list");
  is_damage(changed(forge.layer, [](auto& h) { h.kind = Kind::kEnd; }), "a layer as an end");
  is_damage(changed(forge.layer, [](auto& h) { h.kind = Kind::kPart; }), "a layer as a part");
  is_damage(changed(forge.layer, [](auto& h) { h.kind = Kind::kFooter; }), "a block of a file");
  is_damage(changed(forge.header, [](auto& h) { ++h.context, h.commit = 2; }), "a header under another hash");

  const auto gone = [&](std::vector<GoneRecord> records) {
    return forge.block(Kind::kGone, std::as_bytes(std::span(records)), 2);
  };
  is_damage(gone({}), "an empty list");
  is_damage(gone({{0, 0, 3, {}}}), "a type that does not exist");
  is_damage(gone({{0, 0, 1, {0, 1, 0}}}), "reserved values");
  is_damage(gone({{0, 0, 1, {}}, {0, 0, 1, {}}}), "twice");
  is_damage(gone({{0, 0, 1, {}}, {0, 0, 0, {}}}), "not in order");
  is_damage(forge.block(Kind::kGone, Bytes(24), 2), "half a record");

  const auto end = [&](std::uint64_t first, std::uint64_t flags) {
    EndBody body;
    body.first = first;
    body.flags = flags;
    return forge.block(Kind::kEnd, bytes_of(body), 2);
  };
  is_damage(end(0, 0), "a message without a first block");
  is_damage(end(3, 0), "a message that begins after its end");
  is_damage(end(1, 2), "an unknown flag");
  is_damage(forge.block(Kind::kEnd, Bytes(63), 2), "an end that is too short");
}

// 10.1: only layers and parts of their blocks have one.
TEST(StreamHostileTest, AKeyWhereNoneBelongsIsDamage) {
  const Forge forge;
  EndBody body;
  body.first = 1;
  const std::vector<GoneRecord> records{{0, 0, 0, {}}};
  const Bytes gone = forge.block(Kind::kGone, std::as_bytes(std::span(records)), 2);
  const Bytes end = forge.block(Kind::kEnd, bytes_of(body), 2);
  const Bytes header = changed(forge.header, [](auto& h) { h.commit = 2; });
  for (const Bytes& block : {gone, end, header}) {
    EXPECT_EQ(forge.report({block}).damaged, 0u);
    EXPECT_EQ(forge.report({changed(block, [](auto& h) { h.key = 1; })}).damaged, 1u);
  }
  for (const int kind : {0, 9, 0x80, 0xff}) {
    const StreamReport passed = forge.report({forge.block(static_cast<Kind>(kind), {}, 2)});
    EXPECT_EQ(passed.blocks, 2u) << kind << " is skipped";
    EXPECT_EQ(passed.damaged, 0u) << kind;
    EXPECT_EQ(forge.report({forge.block(static_cast<Kind>(kind), {}, 2, 7)}).damaged, 1u) << kind;
  }
}

TEST(StreamHostileTest, PartsHaveTheKeyOfTheirBlock) {
  const Forge forge;
  const Bytes whole = changed(forge.layer, [](auto& h) { h.commit = 3; });  // of its last part
  const auto report = [&](std::uint64_t first_key, std::uint64_t second_key) {
    const std::size_t cut = (whole.size() / 2 + 7) / 8 * 8;
    Blocks parts;
    for (std::uint32_t i = 0; i < 2; ++i) {
      const PartHead head{i, 2, whole.size()};
      Bytes body(sizeof(head));
      std::memcpy(body.data(), &head, sizeof(head));
      const Bytes piece = i == 0 ? Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(cut))
                                 : Bytes(whole.begin() + static_cast<std::ptrdiff_t>(cut), whole.end());
      body.insert(body.end(), piece.begin(), piece.end());
      parts.push_back(forge.block(Kind::kPart, body, 2 + i, i == 0 ? first_key : second_key));
    }
    return forge.report(parts);
  };
  const std::uint64_t key = head_of(whole).key;
  EXPECT_EQ(report(key, key).layers, 1u);
  EXPECT_EQ(report(key, key).damaged, 0u);
  EXPECT_EQ(report(key + 1, key + 1).damaged, 1u) << "of another block";
  EXPECT_EQ(report(key, key + 1).damaged, 1u) << "of two blocks";
  EXPECT_EQ(report(key + 1, key + 1).layers + report(key, key + 1).layers, 0u);
}

TEST(StreamHostileTest, WhatNeedsANewerReaderIsUnsupported) {
  const Forge forge;
  const auto unknown = static_cast<Kind>(9);
  EXPECT_EQ(forge.report({forge.block(unknown, {}, 2)}).blocks, 2u) << "is skipped";
  EXPECT_EQ(forge.report({changed(forge.block(unknown, {}, 2), [](auto& h) { h.flags = 1; })}).unsupported,
            1u);
  EXPECT_EQ(forge.report({changed(forge.layer, [](auto& h) { h.version = 2; })}).unsupported, 1u);
  Bytes preamble = stream_of(sample_map(1, 1, 1))[0];
  auto p = format::read_as<format::Preamble>(preamble);
  p.incompat = 3;
  p.hash = format::hash_of(bytes_of(p).first(56));
  std::memcpy(preamble.data(), &p, sizeof(p));
  Bytes stream = preamble;
  stream.insert(stream.end(), forge.header.begin(), forge.header.end());
  Receiver receiver;
  EXPECT_EQ(receiver.feed(stream).unsupported, 2u);
  EXPECT_FALSE(receiver.map.has_header());
}

TEST(StreamHostileTest, PartsThatDoNotFitAreDamage) {
  const Forge forge;
  const auto damage = [&](const Blocks& blocks) { return forge.report(blocks).damaged; };
  EXPECT_EQ(damage({forge.part(0, 1, 64, 64, 2)}), 1u) << "a single part";
  EXPECT_EQ(damage({forge.part(2, 2, 128, 64, 9)}), 1u) << "an index beyond the count";
  EXPECT_EQ(damage({forge.part(5, 9, 900, 100, 3)}), 1u) << "a number below the index";
  EXPECT_EQ(damage({forge.part(0, 3, 128, 64, 2)}), 1u) << "more parts than bytes";
  EXPECT_EQ(damage({forge.part(0, 2, 1000, 64, 2)}), 1u) << "fewer parts than bytes";
  EXPECT_EQ(damage({forge.part(0, 2, ~std::uint64_t{7}, 64, 2)}), 1u) << "a whole beyond all limits";
  EXPECT_EQ(damage({forge.part(0, ~0u, 64, 64, 2)}), 1u) << "numbers beyond all limits";
  EXPECT_EQ(damage({forge.part(1, 2, 128, 0, 3)}), 1u) << "an empty part";
  EXPECT_EQ(damage({forge.part(0, 2, 128, 64, 2), forge.part(1, 2, 120, 56, 3)}), 1u) << "two wholes in one";
  const StreamReport report = forge.report({forge.part(0, 2, 128, 64, 2), forge.part(1, 2, 128, 64, 3)});
  EXPECT_EQ(report.damaged, 1u) << "parts of nothing";
  EXPECT_EQ(report.lost, 1u);
}

TEST(StreamHostileTest, PartsThatNeverBecomeABlockAreGivenUp) {
  const Forge forge;
  Log log;
  StreamReader reader(log, {.max_kept_bytes = 100'000});
  reader.datagram(forge.header);
  for (std::uint64_t i = 0; i < 20'000; ++i) {
    reader.datagram(forge.part(0, 1000, 999 * 96 + 8, 96, 2 + 1000 * i));
  }
  const StreamReport report = reader.report();
  EXPECT_EQ(report.incomplete, 20'000u);
  EXPECT_EQ(report.damaged, 0u);
}

TEST(StreamHostileTest, BlocksWithoutAHeaderAreGivenUp) {
  const Forge forge;
  Log log;
  StreamReader reader(log, {.max_kept_bytes = 100'000});
  const std::uint64_t many = 5000;
  for (std::uint64_t i = 1; i <= many; ++i) {
    reader.datagram(changed(forge.layer, [&](auto& h) { h.commit = i + 1; }));
  }
  EXPECT_EQ(reader.report().without_header, many);
  EXPECT_GT(reader.report().lost, many / 2);
  reader.datagram(forge.header);
  EXPECT_LT(reader.report().layers, 1000u);
  EXPECT_GT(reader.report().layers, 10u);
  EXPECT_EQ(reader.report().layers + reader.report().lost, many);
}

TEST(StreamHostileTest, NumbersFarApartTakeNoMemory) {
  const Forge forge;
  Log log;
  StreamReader reader(log);
  reader.datagram(forge.header);
  std::uint64_t number = 1;
  for (int i = 0; i < 20'000; ++i) {
    number += 2 + static_cast<std::uint64_t>(i) * 9;
    reader.datagram(changed(forge.layer, [&](auto& h) { h.commit = number; }));
  }
  const StreamReport report = reader.report();
  EXPECT_EQ(report.layers, 20'000u);
  EXPECT_EQ(report.lost, number - 20'001);
  reader.datagram(changed(forge.layer, [&](auto& h) { h.commit = 2; }));
  EXPECT_EQ(reader.report().late, 1u);
  EXPECT_EQ(reader.report().lost, report.lost);
}

TEST(StreamHostileTest, HeadersWithinHeadersTakeLinearTime) {
  // Each speaks of megabytes, and holds the next.
  Bytes bytes;
  for (std::uint64_t i = 1; bytes.size() < 8'000'000; ++i) {
    format::BlockHeader head;
    head.payload_bytes = 4'000'000;
    head.commit = i;
    Bytes block(sizeof(head));
    std::memcpy(block.data(), &head, sizeof(head));
    format::restamp(block, i, 0);
    bytes.insert(bytes.end(), block.begin(), block.end());
  }
  Log log;
  StreamReader reader(log);
  reader.feed(bytes);
  reader.finish();
  EXPECT_EQ(reader.report().skipped_bytes, bytes.size());
  EXPECT_LT(reader.report().damaged, 200u);
}

TEST(StreamHostileTest, NothingThatArrivesMakesItThrow) {
  const Map map = sample_map(29, 3, 2);
  const Blocks whole = stream_of(map), split = stream_of(map, {.mtu_bytes = 256});
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const auto below = [&](std::size_t n) {
      return static_cast<std::size_t>(random.below(static_cast<int>(n)));
    };
    Receiver receiver({.max_block_bytes = 4096, .max_kept_bytes = 8192});
    for (int i = 0; i < 60; ++i) {
      const Blocks& from = random.chance(0.5) ? whole : split;
      Bytes bytes = from[below(from.size())];
      if (random.chance(0.5) && head_of(bytes).sync == format::kSync) {
        // A wrong field under right hashes.
        auto head = head_of(bytes);
        const std::size_t at = 8 + below(48);
        reinterpret_cast<std::byte*>(&head)[at] ^= static_cast<std::byte>(1 << random.below(8));
        if (random.chance(0.5)) bytes[64 + below(bytes.size() - 64)] ^= std::byte{1};
        const auto size = std::min<std::uint64_t>(head.payload_bytes, bytes.size() - 64);
        head.payload_hash = format::hash_of(std::span(bytes).subspan(64, size));
        std::memcpy(bytes.data(), &head, sizeof(head));
        format::restamp(bytes, head.commit, head.context);
      } else if (random.chance(0.3)) {
        for (std::byte& b : bytes) b = static_cast<std::byte>(random.next());
      } else if (random.chance(0.3)) {
        bytes.resize(below(bytes.size() + 40));
      }
      random.chance(0.5) ? receiver.reader.feed(bytes) : receiver.reader.datagram(bytes);
    }
    receiver.reader.finish();
    const Map arrived = in_memory(receiver.map);
    for (const auto& [key, patch] : arrived.by_key()) {
      for (const auto& [type, layer] : patch.layers) {
        EXPECT_TRUE(is_canonical(layer, receiver.map.header().types[type]));
      }
    }
  }
}

}  // namespace
}  // namespace apgm
