// Both sides of the limits of docs/format.md that tests/conformance does not hold: the largest that is
// allowed is written and read back, one more is refused. What a reader refuses is there, in bad/.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <limits>

#include "apgm/core/error.hpp"
#include "apgm/core/map.hpp"
#include "apgm/format/reader.hpp"
#include "apgm/format/writer.hpp"
#include "apgm/ops/copy.hpp"
#include "tests/support/refusal.hpp"

namespace apgm {
namespace {

using test::refusal;

constexpr std::size_t kMiB = std::size_t{1} << 20;

std::vector<std::byte> written(const MapHeader& header) {
  std::vector<std::byte> bytes;
  Writer writer(bytes, header);
  writer.finish();
  return bytes;
}

std::vector<std::byte> written(const Map& map) {
  std::vector<std::byte> bytes;
  Writer writer(bytes, map.header());
  copy(map, map.header().types, writer, true);
  writer.finish();
  return bytes;
}

void expect_read_back(const MapHeader& header) {
  const auto bytes = written(header);
  const Reader reader(bytes);
  const MapHeader& back = reader.header();
  EXPECT_TRUE(back.frame == header.frame);
  EXPECT_EQ(back.types.size(), header.types.size());
  EXPECT_TRUE(back.metadata == header.metadata);
  EXPECT_TRUE(back.history == header.history);
}

/// Refused as a limit, or as a value that cannot be used.
void expect_refused(const MapHeader& header, ErrorCode code = ErrorCode::kInvalidArgument) {
  EXPECT_EQ(refusal([&] { written(header); }), code);
}

TEST(HeaderLimits, LayerTypes) {
  std::vector<LayerType> types;
  for (int i = 0; i < 4096; ++i) types.push_back(LayerType::real("t" + std::to_string(10'000 + i), {"v"}));
  MapHeader header;
  header.types = TypeTable(types);
  expect_read_back(header);
  types.push_back(LayerType::real("u", {"v"}));
  EXPECT_EQ(refusal([&] { TypeTable{types}; }), ErrorCode::kLimit);
}

TEST(HeaderLimits, MetadataPairs) {
  MapHeader header;
  for (int i = 0; i < 1024; ++i) header.metadata["key" + std::to_string(i)] = "";
  expect_read_back(header);
  header.metadata["one more"] = "";
  expect_refused(header, ErrorCode::kLimit);
}

TEST(HeaderLimits, HistoryEntries) {
  MapHeader header;
  header.history.assign(1024, {"merge", {"a"}, "{}"});
  expect_read_back(header);
  header.history.push_back({"merge", {"a"}, "{}"});
  expect_refused(header, ErrorCode::kLimit);
}

TEST(HeaderLimits, InputsOfAHistoryEntry) {
  MapHeader header;
  header.history.push_back({"merge", std::vector<std::string>(65'536, "a"), "{}"});
  expect_read_back(header);
  header.history[0].inputs.emplace_back("a");
  expect_refused(header, ErrorCode::kLimit);
}

TEST(HeaderLimits, BytesOfTheBlock) {
  const auto with = [](std::size_t bytes) {
    MapHeader header;
    header.metadata["text"] = std::string(bytes, 't');
    return header;
  };
  std::size_t fits = 0, exceeds = 17 * kMiB;
  while (exceeds - fits > 1) {
    const std::size_t middle = (fits + exceeds) / 2;
    try {
      written(with(middle));
      fits = middle;
    } catch (const Error& error) {
      ASSERT_EQ(error.code(), ErrorCode::kLimit);
      exceeds = middle;
    }
  }
  EXPECT_GT(fits, 16 * kMiB - 1024);
  EXPECT_LE(fits, 16 * kMiB);
  expect_read_back(with(fits));
}

TEST(HeaderLimits, Frame) {
  const auto both_sides = [](auto member, auto most, auto more) {
    MapHeader header;
    member(header.frame) = most;
    expect_read_back(header);
    member(header.frame) = more;
    EXPECT_THAT(refusal([&] { written(header); }),
                testing::AnyOf(ErrorCode::kInvalidArgument, ErrorCode::kLimit));
  };
  const auto edge = [](Frame& f) -> std::int64_t& { return f.edge_um; };
  both_sides(edge, 1'000, 999);
  both_sides(edge, 10'000'000'000, 10'000'000'001);
  constexpr std::int64_t kDatum = 1'000'000'000'000'000;
  for (const std::int64_t sign : {1, -1}) {
    both_sides([](Frame& f) -> std::int64_t& { return f.datum_x_um; }, sign* kDatum, sign*(kDatum + 1));
    both_sides([](Frame& f) -> std::int64_t& { return f.datum_y_um; }, sign* kDatum, sign*(kDatum + 1));
  }
  const auto epsg = [](Frame & f) -> auto& { return f.epsg; };
  both_sides(epsg, 1, 0);
  both_sides(epsg, 999'999, 1'000'000);
  const auto id = [](Frame& f) -> std::string& { return f.frame_id; };
  both_sides(id, std::string(1, 'f'), std::string());
  both_sides(id, std::string(255, 'f'), std::string(256, 'f'));
}

// Control characters: below 0x20, and 0x7f. An input holds no space either.
TEST(HeaderLimits, Characters) {
  const auto with = [](char c) {
    const std::string text = std::string("a") + c;
    std::vector<MapHeader> headers(4);
    headers[0].frame.frame_id = text;
    headers[1].metadata[text] = "";
    headers[2].history.push_back({text, {}, "{}"});
    headers[3].history.push_back({"merge", {text}, "{}"});
    return headers;
  };
  for (const char c : {'\x01', '\x1f', '\x7f'}) {
    for (const MapHeader& header : with(c)) expect_refused(header);
  }
  for (const char c : {' ', '!', '~'}) {
    const std::vector<MapHeader> headers = with(c);
    for (std::size_t i = 0; i < headers.size(); ++i) {
      const bool space_in_an_input = c == ' ' && i == 3;
      space_in_an_input ? expect_refused(headers[i]) : expect_read_back(headers[i]);
    }
  }
}

TEST(TypeLimits, NamesChannelsAndSlabs) {
  const auto good = [](const LayerType& type) {
    MapHeader header;
    header.types = TypeTable({type});
    expect_read_back(header);
  };
  const auto bad = [](const LayerType& type) {
    EXPECT_EQ(refusal([&] { TypeTable({type}); }), ErrorCode::kInvalidArgument) << type.name;
  };
  good(LayerType::occupancy(std::string(64, 'n')));
  bad(LayerType::occupancy(std::string(65, 'n')));
  bad(LayerType::occupancy(""));
  std::vector<std::string> names;
  for (int i = 0; i < 15; ++i) names.push_back("c" + std::to_string(i));
  good(LayerType::semantic("most", names));
  names.emplace_back("c15");
  bad(LayerType::semantic("more", names));
  bad(LayerType::semantic("one", {"c0"}));
  good(LayerType::semantic("two", {"c0", "c1"}));
  good(LayerType::real("channels", names));
  names.emplace_back("c16");
  bad(LayerType::real("channels", names));
  bad(LayerType::real("none", {}));
  constexpr std::int64_t kMost = 1'000'000'000'000;
  LayerType slab = LayerType::occupancy();
  slab.slab = Slab{-kMost, kMost};
  good(slab);
  slab.slab = Slab{5, 6};
  good(slab);
  for (const Slab wrong : {Slab{-kMost - 1, 0}, Slab{0, kMost + 1}, Slab{5, 5}}) {
    slab.slab = wrong;
    bad(slab);
  }
}

TEST(LayerLimits, StepsAndBytes) {
  MapHeader header;
  header.types = TypeTable({LayerType::real("four", {"a", "b", "c", "d"})});
  const LayerType five = LayerType::real("five", {"a", "b", "c", "d", "e"});
  Map map(header);
  Layer& layer = map.layer({0, 0}, 0, 11);  // 64 MiB
  EXPECT_EQ(layer.value_bytes(), Layer::kMaxBytes);
  layer.at(3, {2047, 2047}) = 7;
  const auto bytes = written(map);
  const Reader reader(bytes);
  PatchInfo patch;
  ASSERT_TRUE(reader.patches()->next(patch));
  Layer back;
  reader.load(patch.layers[0], back);
  EXPECT_TRUE(same_cells(layer, back));
  EXPECT_EQ(refusal([&] { Layer(five, 11); }), ErrorCode::kLimit);
  EXPECT_NO_THROW(Layer(five, 10));
  EXPECT_EQ(refusal([&] { Layer(header.types[0], 12); }), ErrorCode::kLimit);
}

// The palette ends at 4096 tuples; what holds more takes another encoding, and nothing is lost.
TEST(LayerLimits, TuplesOfAPalette) {
  for (const int tuples : {4096, 4097}) {
    MapHeader header;
    header.types = TypeTable({LayerType::real("height", {"z"})});
    Map map(header);
    Layer& layer = map.layer({0, 0}, 0, 9);
    const auto all = static_cast<std::uint32_t>(tuples);
    for (std::uint32_t i = 0; i < layer.cells(); ++i) {
      // Every fourth cell may be a new tuple, the others are of 64: many that come back, so that a palette
      // pays.
      const std::uint32_t mixed = i * 2654435761u >> 12;
      const std::uint32_t tuple = i % 4 != 0 ? mixed % 64 : i / 4 < all ? i / 4 : mixed % all;
      // In [1, 2), without bytes in common: what a palette does not name takes four bytes.
      layer.plane(0)[i] = std::bit_cast<float>(0x3f800000u | (tuple * 2654435761u & 0x7fffffu));
    }
    const auto bytes = written(map);
    const Reader reader(bytes);
    PatchInfo patch;
    ASSERT_TRUE(reader.patches()->next(patch));
    EXPECT_EQ(patch.layers[0].encoding == 2, tuples == 4096);
    Layer back;
    reader.load(patch.layers[0], back);
    EXPECT_TRUE(same_cells(layer, back));
  }
}

TEST(WriterLimits, Levels) {
  for (const int level : {0, 1, 19, 20}) {
    std::vector<std::byte> bytes;
    WriterOptions options;
    options.level = level;
    const auto make = [&] { Writer writer(bytes, MapHeader(), options); };
    if (level == 1 || level == 19) {
      EXPECT_NO_THROW(make());
    } else {
      EXPECT_EQ(refusal(make), ErrorCode::kInvalidArgument);
    }
  }
}

}  // namespace
}  // namespace apgm
