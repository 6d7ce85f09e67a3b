#include "apgm/format/message.hpp"

#include <cstring>

#include <gmock/gmock.h>

#include "apgm/core/error.hpp"
#include "random_map.hpp"
#include "sample_map.hpp"
#include "temp_dir.hpp"

namespace apgm {
namespace {

using test::difference;
using test::random_map;
using test::sample_map;
using test::TempDir;

std::string as_text(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

MapChanges some_changes() {
  MapChanges changes{sample_map(4), {}};
  changes.gone = {{{-77, -5}, "semantic"}, {{77, 5}, "occupancy"}, {{77, 5}, "velocity"}};
  return changes;
}

/// The bytes of a map whose list of what is gone is `text`.
std::vector<std::byte> message_with(const std::string& text) {
  MapHeader header = sample_map(4).header();
  header.metadata["apgm.gone"] = text;
  return to_bytes(Map(header));
}

TEST(MessageTest, IsTheFileThatAWriterWrites) {
  TempDir dir;
  for (const Lossy lossy : {Lossy::kNone, Lossy::kU8}) {
    WriterOptions options;
    options.lossy = lossy;
    test::write_map(sample_map(2), dir / "map.apgm", options);
    EXPECT_EQ(as_text(to_bytes(sample_map(2), options)), test::read_file(dir / "map.apgm"));
    const Reader reader(dir / "map.apgm");
    EXPECT_EQ(as_text(to_bytes(reader, options)), test::read_file(dir / "map.apgm"));
    std::filesystem::remove(dir / "map.apgm");
  }
}

TEST(MessageTest, MapsComeBackBitByBit) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Map map = random_map(seed);
    const Map back = map_from_bytes(to_bytes(map));
    EXPECT_EQ(difference(map, back, true), "");
    EXPECT_EQ(back.header().types, map.header().types);
    EXPECT_EQ(back.header().frame, map.header().frame);
  }
}

TEST(MessageTest, ChangesComeBackWithWhatIsGone) {
  const MapChanges changes = some_changes();
  const MapChanges back = changes_from_bytes(to_bytes(changes));
  EXPECT_EQ(back.gone, changes.gone);
  EXPECT_EQ(difference(back.changed, changes.changed, true), "");
  EXPECT_EQ(back.changed.header().metadata, changes.changed.header().metadata);
}

TEST(MessageTest, ChangesWithoutAnythingGoneAreTheBytesOfAMap) {
  const MapChanges changes{sample_map(4), {}};
  EXPECT_EQ(to_bytes(changes), to_bytes(changes.changed));
  EXPECT_TRUE(changes_from_bytes(to_bytes(changes)).gone.empty());
}

TEST(MessageTest, ListsThatBreakTheirRulesAreNotWritten) {
  MapChanges disordered = some_changes();
  std::swap(disordered.gone[0], disordered.gone[1]);
  EXPECT_THROW(to_bytes(disordered), Error);
  MapChanges unknown = some_changes();
  unknown.gone[0].layer = "other";
  EXPECT_THROW(to_bytes(unknown), Error);
  MapChanges both = some_changes();
  both.gone = {{both.changed.by_key().begin()->second.index, "occupancy"}};
  EXPECT_THROW(to_bytes(both), Error);
}

TEST(MessageTest, MalformedListsAreDamage) {
  for (const char* text : {"1", "1 2", "1 2 ", "1 2  occupancy", " 1 2 occupancy", "1 2 other",
                           "1 2147483648 occupancy", "1 2x occupancy", "1 2 occupancy 3", "0x1 2 occupancy",
                           "1 2 occupancy 1 2 occupancy", "77 5 velocity 77 5 occupancy", "0 0 occupancy ",
                           "00 0 occupancy", "0 -0 occupancy", "+1 0 occupancy", " "}) {
    SCOPED_TRACE(text);
    const auto bytes = message_with(text);
    EXPECT_NO_THROW(map_from_bytes(bytes));
    try {
      changes_from_bytes(bytes);
      ADD_FAILURE() << "was accepted";
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::kDamaged);
    }
  }
}

TEST(MessageTest, EveryCutAndEveryFlippedByteIsFound) {
  MapChanges changes{Map(sample_map(4).header()), {{{1, 2}, "velocity"}}};
  changes.changed.layer({0, 0}, 0, 1).plane(0)[0] = 0.5f;
  const std::vector<std::byte> bytes = to_bytes(changes);
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    EXPECT_THROW(changes_from_bytes(std::span(bytes).first(n)), Error) << n;
  }
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    auto flipped = bytes;
    flipped[i] ^= std::byte{0x10};
    EXPECT_THROW(changes_from_bytes(flipped), Error) << i;
  }
}

TEST(MessageTest, ALargeMapInASmallMessageIsRefusedBeforeItIsMade) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  Map map(header);
  std::ranges::fill(map.layer({0, 0}, 0, 9).plane(0), 0.5f);
  const auto bytes = to_bytes(map);
  EXPECT_LT(bytes.size(), 4096u);
  EXPECT_NO_THROW(map_from_bytes(bytes, std::uint64_t{8} << 18));
  try {
    map_from_bytes(bytes, (std::uint64_t{8} << 18) - 1);
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kLimit);
  }
}

}  // namespace
}  // namespace apgm
