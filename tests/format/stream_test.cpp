#include <gmock/gmock.h>

#include "stream_support.hpp"

namespace apgm {
namespace {

using namespace test;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr std::uint32_t kMtus[] = {0, 256, 300, 1400, 65'507};

TEST(StreamTest, AMapArrivesWholeThroughAPipe) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    for (const std::uint32_t mtu : kMtus) {
      SCOPED_TRACE("seed " + std::to_string(seed) + ", mtu " + std::to_string(mtu));
      const Map map = sample_map(seed);
      Receiver receiver;
      const StreamReport report = receiver.feed(joined(stream_of(map, {.mtu_bytes = mtu})));
      EXPECT_TRUE(report.complete()) << report.fault;
      EXPECT_EQ(report.fault, "");
      EXPECT_EQ(difference(map, in_memory(receiver.map), true), "");
      EXPECT_EQ(receiver.map.content_id(), content_id_of(map));
      EXPECT_EQ(receiver.map.is_as_said(), true);
      EXPECT_EQ(receiver.map.header().metadata, map.header().metadata);
      EXPECT_EQ(receiver.map.header().history, map.header().history);
    }
  }
}

TEST(StreamTest, AWriterMakesTheSameFileOfWhatArrived) {
  const Map map = sample_map(3);
  TempDir dir;
  write_map(map, dir / "a.apgm");
  const Reader reader(dir / "a.apgm");
  Receiver receiver;
  receiver.feed(joined(stream_of(reader)));
  write_map(receiver.map, dir / "b.apgm");
  EXPECT_EQ(read_file(dir / "a.apgm"), read_file(dir / "b.apgm"));
}

TEST(StreamTest, AnEmptyMapIsAHeaderAndAnEnd) {
  const Blocks blocks = stream_of(Map(sample_map(1).header()));
  ASSERT_EQ(blocks.size(), 3u);
  EXPECT_TRUE(is_stream(blocks[0]));
  Receiver receiver;
  EXPECT_TRUE(receiver.feed(joined(blocks)).complete());
  EXPECT_EQ(receiver.map.is_as_said(), true);
  EXPECT_EQ(receiver.map.summary().patches, 0u);
}

TEST(StreamTest, SameCallsGiveTheSameBytes) {
  EXPECT_EQ(stream_of(sample_map(5), {.mtu_bytes = 512}), stream_of(sample_map(5), {.mtu_bytes = 512}));
}

TEST(StreamTest, NoBlockExceedsTheMtuAndAllAreNumbered) {
  for (std::uint32_t mtu = 256; mtu < 2000; mtu += 57) {
    SCOPED_TRACE(mtu);
    const Blocks blocks = stream_of(sample_map(7), {.mtu_bytes = mtu});
    for (std::size_t i = 1; i < blocks.size(); ++i) {
      EXPECT_LE(blocks[i].size(), mtu);
      EXPECT_EQ(head_of(blocks[i]).commit, i);
    }
    Receiver receiver;
    EXPECT_TRUE(receiver.datagrams(blocks).complete());
    EXPECT_EQ(receiver.map.is_as_said(), true);
  }
}

TEST(StreamTest, OptionsThatCannotBeMetAreRefused) {
  const auto refused = [](const StreamOptions& options) {
    EXPECT_THROW(StreamWriter([](auto) {}, MapHeader{}, options), Error);
  };
  refused({.level = 0});
  refused({.level = 20});
  refused({.mtu_bytes = 255});
}

TEST(StreamMapTest, AStreamOfChangesMakesTheNewMapOfItsBase) {
  const Map base = row_of_patches(5);
  Map now = in_memory(base);
  now.extract({1, 0}, *base.header().types.find("occupancy"));
  now.layer({9, 9}, *base.header().types.find("height"), 1).plane(0)[0] = 2.5f;
  Map changes(base.header());
  changes.layer({9, 9}, *base.header().types.find("height"), 1).plane(0)[0] = 2.5f;
  Sent sent;
  StreamWriter writer(sent.output(), base.header());
  const std::vector<MapChanges::Gone> gone{{{1, 0}, "occupancy"}};
  send(changes, writer);
  writer.gone(gone);
  writer.end({content_id_of(base), content_id_of(now)});
  EXPECT_EQ(writer.written().content_id, content_id_of(now));
  TempDir dir;
  write_map(base, dir / "base.apgm");
  const Reader file(dir / "base.apgm");
  const PatchSource* const sources[] = {&base, &file};
  for (const PatchSource* source : sources) {
    Receiver receiver;
    receiver.map.start_from(*source);
    EXPECT_TRUE(receiver.feed(joined(sent.blocks)).complete());
    EXPECT_EQ(receiver.map.base(), content_id_of(base));
    EXPECT_EQ(receiver.map.is_as_said(), true);
    EXPECT_EQ(difference(now, in_memory(receiver.map)), "");
  }
  Receiver without;
  without.feed(joined(sent.blocks));
  EXPECT_EQ(without.map.is_as_said(), false);
}

TEST(StreamMapTest, RoundedMassesKeepTheirBound) {
  const Map map = sample_map(31);
  Receiver receiver;
  EXPECT_TRUE(receiver.feed(joined(stream_of(map, {.lossy = Lossy::kU8}))).complete());
  EXPECT_EQ(receiver.map.is_as_said(), true);
  PatchInfo patch;
  StoredLayer stored;
  float largest = 0;
  for (const auto cursor = receiver.map.patches(); cursor->next(patch);) {
    for (const LayerInfo& info : patch.layers) {
      EXPECT_TRUE(receiver.map.load_stored(info, stored));
      largest = std::max(largest, stored.error_bound);
    }
  }
  EXPECT_FLOAT_EQ(largest, 1.0f / 255);
}

TEST(StreamTest, TheEndSaysWhatTheMessageHeld) {
  Sent sent;
  const Map map = row_of_patches(2);
  StreamWriter writer(sent.output(), map.header());
  test::stream(map, writer);
  writer.gone(std::vector<MapChanges::Gone>{{{0, 0}, "occupancy"}, {{1, 0}, "occupancy"}});
  const std::string base(32, 'a'), result(32, 'b');
  writer.end({base, result});
  writer.finish();  // nothing is open
  Log log;
  StreamReader reader(log);
  reader.feed(joined(sent.blocks));
  EXPECT_THAT(log.lines,
              ElementsAre("header 2", "layer 0,0 occupancy", "layer 1,0 occupancy", "end 2 0 missing 0",
                          "gone 0,0 occupancy", "gone 1,0 occupancy", "end 0 2 missing 0"));
  EXPECT_EQ(log.last.first.base, base);
  EXPECT_EQ(log.last.first.result, result);
  EXPECT_FALSE(log.last.second);
  EXPECT_EQ(writer.written().messages, 2u);
  EXPECT_EQ(writer.written().gone, 2u);
  EXPECT_EQ(writer.written().blocks, sent.blocks.size() - 1);
  EXPECT_EQ(writer.written().bytes, joined(sent.blocks).size());
}

TEST(StreamTest, LongListsOfWhatIsGoneAreSplit) {
  std::vector<MapChanges::Gone> gone;
  for (int x = 0; x < 10'000; ++x) gone.push_back({{x, 0}, "occupancy"});
  std::ranges::sort(gone, {}, [](const auto& g) { return curve_key(g.patch); });
  for (const std::uint32_t mtu : kMtus) {
    Sent sent;
    StreamWriter writer(sent.output(), row_of_patches(1).header(), {.mtu_bytes = mtu});
    writer.gone(gone);
    writer.end({});
    Log log;
    StreamReader reader(log);
    reader.feed(joined(sent.blocks));
    EXPECT_TRUE(reader.report().complete()) << reader.report().fault;
    EXPECT_EQ(reader.report().gone, gone.size());
  }
}

TEST(StreamTest, AMapSentAgainTakesWhatItNoLongerHolds) {
  Sent sent;
  const Map first = row_of_patches(5), second = row_of_patches(2, 0.25f);
  StreamWriter writer(sent.output(), first.header());
  test::stream(first, writer);
  test::stream(second, writer);
  Receiver receiver;
  EXPECT_TRUE(receiver.feed(joined(sent.blocks)).complete());
  EXPECT_EQ(receiver.map.is_as_said(), true);
  EXPECT_EQ(receiver.map.content_id(), content_id_of(second));
}

TEST(StreamTest, AHeaderMayChangeBetweenMessages) {
  Sent sent;
  const Map first = row_of_patches(3);
  StreamWriter writer(sent.output(), first.header());
  test::stream(first, writer);
  MapHeader wider = first.header();
  wider.types = TypeTable({LayerType::occupancy(), LayerType::real("aaa", {"v"}),
                           LayerType::semantic("zzz", {"a", "b"})});  // height is no more, numbers shift
  Map more(wider);
  more.layer({0, 7}, *wider.types.find("zzz"), 0).plane(0)[0] = 0.5f;
  more.layer({0, 7}, *wider.types.find("zzz"), 0).plane(2)[0] = 0.5f;
  writer.set_header(wider);
  send(more, writer);
  EXPECT_THROW(writer.set_header(first.header()), Error);
  writer.end({content_id_of(first), ""});
  for (int x = 0; x < 3; ++x) {
    more.layer({x, 0}, *wider.types.find("occupancy"), 2) =
        *first.find({x, 0}, *first.header().types.find("occupancy"));
  }
  Receiver receiver;
  EXPECT_TRUE(receiver.feed(joined(sent.blocks)).complete());
  EXPECT_EQ(receiver.map.content_id(), content_id_of(more));
}

TEST(StreamTest, AFileIsNoStreamAndAStreamNoFile) {
  TempDir dir;
  write_map(row_of_patches(2), dir / "map.apgm");
  const std::string file = read_file(dir / "map.apgm");
  Log log;
  StreamReader reader(log);
  reader.feed(std::as_bytes(std::span(file)));
  EXPECT_THAT(log.lines, IsEmpty());
  EXPECT_GT(reader.report().unsupported, 0u);
  EXPECT_FALSE(reader.report().complete());
  EXPECT_EQ(reader.report().fault, "a map file, not a stream");

  const Bytes bytes = joined(stream_of(row_of_patches(2)));
  try {
    const Reader as_file(bytes);
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kUnsupported);
    EXPECT_THAT(e.message(), testing::HasSubstr("is a stream"));
    EXPECT_THAT(e.hint(), testing::HasSubstr("apgm-convert"));
  }
}

TEST(StreamTest, SaysWhatPackingTakesAsAWriterDoes) {
  const MapHeader header = row_of_patches(1).header();
  std::vector<std::byte> bytes;
  Sent sent;
  constexpr std::uint64_t kLayerBytes = std::uint64_t{8} << 20;
  std::uint64_t last = 0;
  for (const int level : {1, 19}) {
    WriterOptions options;
    options.level = level;
    const Writer file(bytes, header, options);
    const StreamWriter stream(sent.output(), header, {.level = level});
    EXPECT_EQ(working_bytes<PatchSink>(stream, kLayerBytes), working_bytes<PatchSink>(file, kLayerBytes));
    EXPECT_GT(working_bytes<PatchSink>(stream, kLayerBytes), last);
    last = working_bytes<PatchSink>(stream, kLayerBytes);
  }
}

}  // namespace
}  // namespace apgm
