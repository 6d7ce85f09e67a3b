#include <gmock/gmock.h>

#include "stream_support.hpp"

namespace apgm {
namespace {

using namespace test;

TEST(StreamReaderTest, BytesMayBeCutAnywhere) {
  const Map map = sample_map(11, 3, 3);
  const Bytes bytes = joined(stream_of(map, {.mtu_bytes = 512}));
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const int longest = seed == 0 ? 1 : 1 << random.in(1, 12);
    Receiver receiver;
    for (std::size_t at = 0; at < bytes.size();) {
      const auto size =
          std::min<std::size_t>(static_cast<std::size_t>(random.in(0, longest)), bytes.size() - at);
      receiver.reader.feed(std::span(bytes).subspan(at, size));
      at += size;
    }
    EXPECT_TRUE(receiver.reader.report().complete());
    EXPECT_EQ(receiver.map.is_as_said(), true);
  }
}

TEST(StreamReaderTest, ABlockThatIsLostCostsWhatItHolds) {
  const Map map = sample_map(13);
  const Blocks blocks = stream_of(map);
  for (std::size_t drop = 1; drop < blocks.size(); ++drop) {
    SCOPED_TRACE(drop);
    Blocks rest = blocks;
    rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(drop));
    Log log;
    const StreamReport report = report_of(joined(rest), log);
    EXPECT_FALSE(report.complete());
    if (drop == 1) {  // the only header: nothing can be read without
      EXPECT_EQ(report.without_header, blocks.size() - 2);
      continue;
    }
    const bool is_end = drop + 1 == blocks.size();
    EXPECT_EQ(report.lost, is_end ? 0u : 1u);
    EXPECT_EQ(report.ended, !is_end);
    EXPECT_EQ(report.layers, blocks.size() - (is_end ? 3 : 4));
    if (!is_end) {
      EXPECT_THAT(log.lines.back(), testing::EndsWith("missing 1"));
    }
  }
}

TEST(StreamReaderTest, EveryFlippedByteIsFoundAndCostsItsBlock) {
  const Blocks blocks = stream_of(sample_map(17, 2, 2), {.header_every_bytes = 1});
  const Bytes bytes = joined(blocks);
  std::size_t block = 0, end = blocks[0].size();
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    if (i == end) end += blocks[++block].size();
    SCOPED_TRACE(i);
    Bytes flipped = bytes;
    flipped[i] ^= std::byte{0x04};
    Log log;
    const StreamReport report = report_of(flipped, log);
    EXPECT_FALSE(report.complete());
    EXPECT_EQ(report.blocks, blocks.size() - (block == 0 ? 1 : 2));
    EXPECT_EQ(report.skipped_bytes, blocks[block].size());
    EXPECT_LE(report.damaged, 1u);
    EXPECT_NE(report.fault, "");
  }
}

TEST(StreamReaderTest, EveryCutIsFound) {
  const Bytes bytes = joined(stream_of(sample_map(19, 2, 2)));
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    Log log;
    const StreamReport report = report_of(std::span(bytes).first(size), log);
    EXPECT_FALSE(report.complete()) << size;
    EXPECT_EQ(report.skipped_bytes + report.blocks > 0, size != 0 && size != 64) << size;
  }
}

TEST(StreamReaderTest, BytesLostOrPutInCostTheBlocksTheyTouch) {
  const Blocks blocks = stream_of(sample_map(23));
  const Bytes bytes = joined(blocks);
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    Bytes changed = bytes;
    const auto at = changed.begin() + random.in(64, static_cast<int>(bytes.size()) - 400);
    const int size = random.in(1, 300);
    if (random.chance(0.5)) {
      changed.erase(at, at + size);
    } else {
      changed.insert(at, static_cast<std::size_t>(size), std::byte{0x41});
    }
    Log log;
    const StreamReport report = report_of(changed, log);
    EXPECT_FALSE(report.complete());
    EXPECT_GE(report.blocks + 3 + 300 / 128, blocks.size() - 1);
  }
}

TEST(StreamReaderTest, ReorderedAndDoubledDatagramsDoNoHarm) {
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const Map map = random_map(seed);
    Blocks blocks = stream_of(map, {.mtu_bytes = seed % 2 == 0 ? 512u : 0u});
    const std::size_t once = blocks.size() - 1;
    for (std::size_t i = once; i > 0; --i) {
      if (random.chance(0.3))
        blocks.push_back(blocks[static_cast<std::size_t>(random.below(static_cast<int>(i)))]);
    }
    for (std::size_t i = blocks.size() - 1; i > 0; --i) {
      std::swap(blocks[i], blocks[static_cast<std::size_t>(random.below(static_cast<int>(i) + 1))]);
    }
    Receiver receiver;
    const StreamReport report = receiver.datagrams(blocks);
    EXPECT_TRUE(report.complete()) << report.fault;
    EXPECT_EQ(report.blocks, once);
    EXPECT_EQ(report.lost, 0u);
    EXPECT_EQ(difference(map, in_memory(receiver.map), true), "");
  }
}

TEST(StreamReaderTest, OfALayerNoOlderStateComesAfterANewerOne) {
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    Sent sent;
    Map map = row_of_patches(6);
    StreamWriter writer(sent.output(), map.header(), {.mtu_bytes = 256});
    for (int round = 0; round < 20; ++round) {
      Map changes(map.header());
      std::vector<MapChanges::Gone> gone;
      for (int x = 0; x < 6; ++x) {
        if (!random.chance(0.5)) continue;
        if (random.chance(0.2)) {
          gone.push_back({{x, 0}, "occupancy"});
          map.extract({x, 0}, *map.header().types.find("occupancy"));
          continue;
        }
        for (Map* m : {&map, &changes}) {
          m->layer({x, 0}, *map.header().types.find("occupancy"), 2).plane(0)[3] =
              static_cast<float>(1 + round) / 64;
        }
      }
      send(changes, writer);
      writer.gone(gone);
      writer.end({"", content_id_of(map)});
    }
    for (std::size_t i = 1; i + 1 < sent.blocks.size(); ++i) {
      const auto to =
          std::min<std::size_t>(i + static_cast<std::size_t>(random.below(9)), sent.blocks.size() - 1);
      std::swap(sent.blocks[i], sent.blocks[to]);
    }
    Receiver receiver;
    const StreamReport report = receiver.datagrams(sent.blocks);
    EXPECT_EQ(report.lost, 0u);
    EXPECT_EQ(report.messages, 20u);
    EXPECT_EQ(receiver.map.content_id(), content_id_of(map));
  }
}

TEST(StreamReaderTest, AListOfWhatIsGoneThatComesLastIsAllSuperseded) {
  // The block fills the last gap, after which no order needs to be kept: but for the rest of its list.
  const Map map = row_of_patches(3);
  Sent sent;
  StreamWriter writer(sent.output(), map.header());
  send(map, writer);
  writer.end({});
  writer.gone(
      std::vector<MapChanges::Gone>{{{0, 0}, "occupancy"}, {{1, 0}, "occupancy"}, {{2, 0}, "occupancy"}});
  writer.end({});
  send(map, writer);
  writer.end({"", content_id_of(map)});
  const auto gone =
      std::ranges::find(sent.blocks, format::Kind::kGone, [](const Bytes& b) { return head_of(b).kind; });
  ASSERT_NE(gone, sent.blocks.end());
  std::rotate(gone, gone + 1, sent.blocks.end());
  Receiver receiver;
  const StreamReport report = receiver.datagrams(sent.blocks);
  EXPECT_TRUE(report.complete()) << report.fault;
  EXPECT_EQ(report.gone, 3u);
  EXPECT_EQ(report.superseded, 3u);
  EXPECT_EQ(receiver.map.is_as_said(), true);
}

TEST(StreamReaderTest, WhoJoinsLateReadsOnFromTheNextHeader) {
  const Map map = row_of_patches(64);
  const Blocks blocks = stream_of(map, {.header_every_bytes = 2048});
  const auto headers = std::ranges::count_if(blocks.begin() + 1, blocks.end(), [](const Bytes& b) {
    return head_of(b).kind == format::Kind::kMapHeader;
  });
  EXPECT_GT(headers, 1);
  const std::size_t joined_at = 20;
  Receiver receiver;
  const StreamReport report = receiver.datagrams(Blocks(blocks.begin() + joined_at, blocks.end()));
  EXPECT_EQ(report.without_header, 0u) << "blocks before the header wait for it";
  EXPECT_EQ(report.lost, joined_at - 1);
  EXPECT_EQ(report.blocks, blocks.size() - joined_at);
  EXPECT_EQ(receiver.map.is_as_said(), false);
  EXPECT_GT(receiver.map.summary().patches, 64u - joined_at);
}

TEST(StreamReaderTest, StreamsMayFollowEachOtherInAPipe) {
  const Map a = row_of_patches(3), b = row_of_patches(7, 0.125f);
  Bytes bytes = joined(stream_of(a));
  const Bytes second = joined(stream_of(b));
  bytes.insert(bytes.end(), second.begin(), second.end());
  Receiver receiver;
  const StreamReport report = receiver.feed(bytes);
  EXPECT_TRUE(report.complete()) << report.fault;
  EXPECT_EQ(report.messages, 2u);
  EXPECT_EQ(receiver.map.content_id(), content_id_of(b));
}

TEST(StreamReaderTest, ASenderThatStartsAgainIsHeardByItsSession) {
  const Map a = row_of_patches(9), b = row_of_patches(4, 0.125f);
  const Blocks old = stream_of(a, {.session = 7}), fresh = stream_of(b, {.session = 8});
  Receiver receiver;
  receiver.datagrams(old);
  receiver.datagrams(fresh);
  const StreamReport report = receiver.datagrams({old[3]});
  EXPECT_EQ(report.late, 1u);
  EXPECT_EQ(report.lost, 0u);
  EXPECT_EQ(receiver.map.content_id(), content_id_of(b));
}

TEST(StreamReaderTest, WhatTheHandlerThrowsComesOutAndTheReaderGoesOn) {
  struct Thrower final : StreamHandler {
    void layer(const StreamLayer&) override {
      if (++layers == 2) throw std::runtime_error("full");
    }
    void gone(const StreamGone&) override {}
    int layers = 0;
  };
  Thrower thrower;
  StreamReader reader(thrower);
  EXPECT_THROW(reader.feed(joined(stream_of(row_of_patches(5)))), std::runtime_error);
  reader.feed({});
  EXPECT_EQ(thrower.layers, 5);
  EXPECT_TRUE(reader.report().complete());
}

}  // namespace
}  // namespace apgm
