#include "apgm/format/reader.hpp"

#include <gmock/gmock.h>

#include <thread>

#include "apgm/core/error.hpp"
#include "sample_map.hpp"
#include "temp_dir.hpp"

namespace apgm {
namespace {

using test::sample_map;
using test::TempDir;
using test::write_map;

TEST(ReaderTest, GivesBackEveryBitOfRandomMaps) {
  TempDir dir;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    SCOPED_TRACE(seed);
    const Map map = sample_map(seed, static_cast<int>(seed % 12), 7);
    WriterOptions options;
    options.output.overwrite = true;
    write_map(map, dir / "a.apgm", options);
    ASSERT_TRUE(test::same_map(map, test::read_map(dir / "a.apgm")));
  }
}

TEST(ReaderTest, GivesBackTheHeader) {
  TempDir dir;
  MapHeader header = sample_map(1).header();
  LayerType slice = LayerType::occupancy("slice", Policy::kExclusive);
  slice.slab = Slab{-80'000, 80'000};
  header.types = TypeTable({slice, LayerType::occupancy()});
  header.stamp_ns = 42;
  write_map(Map(header), dir / "a.apgm");
  const Reader reader(dir / "a.apgm");
  EXPECT_EQ(reader.header().frame, header.frame);
  EXPECT_EQ(reader.header().types, header.types);
  EXPECT_EQ(reader.header().metadata, header.metadata);
  EXPECT_EQ(reader.header().history, header.history);
  EXPECT_EQ(reader.header().stamp_ns, 42);
  EXPECT_EQ(reader.file().commits, 1u);
  EXPECT_EQ(reader.file().version_major, 1);
}

TEST(ReaderTest, SummaryAgreesWithTheMap) {
  TempDir dir;
  const Map map = sample_map(5, 20);
  const auto report = write_map(map, dir / "a.apgm");
  const Reader reader(dir / "a.apgm");
  const Summary expected = map.summary(), got = reader.summary();
  EXPECT_EQ(got.patches, expected.patches);
  EXPECT_EQ(got.range, expected.range);
  ASSERT_EQ(got.types.size(), expected.types.size());
  for (std::size_t t = 0; t < got.types.size(); ++t) {
    EXPECT_EQ(got.types[t].layers, expected.types[t].layers);
    EXPECT_EQ(got.types[t].raw_bytes, expected.types[t].raw_bytes);
    EXPECT_EQ(got.types[t].layers_at, expected.types[t].layers_at);
  }
  EXPECT_EQ(reader.content_id(), report.content_id);
  EXPECT_EQ(reader.file().file_bytes, report.file_bytes);
}

TEST(ReaderTest, EmptyMapIsValid) {
  TempDir dir;
  write_map(Map(sample_map(1).header()), dir / "a.apgm");
  const Reader reader(dir / "a.apgm");
  PatchInfo patch;
  EXPECT_FALSE(reader.patches()->next(patch));
  EXPECT_TRUE(reader.summary().range.empty());
}

TEST(ReaderTest, CursorGivesThePatchesOfARangeInKeyOrder) {
  TempDir dir;
  const Map map = sample_map(6, 40, 2);
  write_map(map, dir / "a.apgm");
  const Reader reader(dir / "a.apgm");
  const PatchRange range{{-2, -3}, {1, 2}};
  std::vector<PatchIndex> expected, got;
  for (const auto& [key, patch] : map.by_key()) {
    if (range.contains(patch.index)) expected.push_back(patch.index);
  }
  PatchInfo patch;
  const auto cursor = reader.patches(range);
  while (cursor->next(patch)) got.push_back(patch.patch);
  EXPECT_EQ(got, expected);
  EXPECT_FALSE(expected.empty());
}

TEST(ReaderTest, ManyPagesAreReadInOrder) {
  TempDir dir;
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy("a"), LayerType::occupancy("b")});
  Map map(header);
  for (std::int32_t x = 0; x < 80; ++x) {
    for (std::int32_t y = 0; y < 80; ++y) {
      map.layer({x, y}, 0, 0).plane(0)[0] = 0.5f;
      map.layer({x, y}, 1, 0).plane(1)[0] = 0.25f;
    }
  }
  write_map(map, dir / "a.apgm");
  const Reader reader(dir / "a.apgm");
  PatchInfo patch;
  std::uint64_t last = 0, count = 0;
  const auto cursor = reader.patches();
  while (cursor->next(patch)) {
    ASSERT_EQ(patch.layers.size(), 2u);
    ASSERT_TRUE(count == 0 || curve_key(patch.patch) > last);
    last = curve_key(patch.patch);
    ++count;
  }
  EXPECT_EQ(count, 6400u);
  EXPECT_TRUE(test::same_map(map, test::read_map(dir / "a.apgm")));
}

TEST(ReaderTest, StoredLayersWriteTheSameFile) {
  TempDir dir;
  write_map(sample_map(9, 12), dir / "a.apgm");
  const Reader reader(dir / "a.apgm");
  Writer writer(dir / "b.apgm", reader.header());
  const auto cursor = reader.patches();
  PatchInfo patch;
  while (cursor->next(patch)) {
    std::vector<Parcel> parcels(patch.layers.size());
    for (std::size_t i = 0; i < parcels.size(); ++i) {
      parcels[i].patch = patch.patch;
      parcels[i].type = patch.layers[i].type;
      parcels[i].stamp_ns = patch.layers[i].stamp_ns;
      parcels[i].state = Parcel::State::kStored;
      ASSERT_TRUE(reader.load_stored(patch.layers[i], parcels[i].stored));
      writer.pack(parcels[i]);
    }
    writer.put(patch.patch, parcels);
  }
  writer.finish();
  EXPECT_EQ(test::read_file(dir / "a.apgm"), test::read_file(dir / "b.apgm"));
}

TEST(ReaderTest, LoadsFromManyThreads) {
  TempDir dir;
  const Map map = sample_map(10, 20, 6);
  write_map(map, dir / "a.apgm");
  const Reader reader(dir / "a.apgm");
  const auto read_all = [&] {
    const auto cursor = reader.patches();
    PatchInfo patch;
    Layer layer;
    while (cursor->next(patch)) {
      for (const LayerInfo& info : patch.layers) {
        reader.load(info, layer);
        ASSERT_TRUE(same_cells(layer, *map.find(patch.patch, info.type)));
      }
    }
  };
  std::thread a(read_all), b(read_all);
  a.join();
  b.join();
}

ErrorCode code_of(const std::string& path) {
  try {
    test::read_map(path);
  } catch (const Error& e) {
    EXPECT_FALSE(e.path().empty());
    return e.code();
  }
  ADD_FAILURE() << "no error for " << path;
  return ErrorCode::kCancelled;
}

TEST(ReaderTest, NamesWhatAForeignFileIs) {
  TempDir dir;
  test::write_file(dir / "empty", "");
  test::write_file(dir / "a.png", "\x89PNG\r\n\x1a\n and so on");
  EXPECT_EQ(code_of(dir / "missing"), ErrorCode::kUnreadable);
  EXPECT_EQ(code_of(dir.path()), ErrorCode::kUnreadable);
  EXPECT_EQ(code_of(dir / "empty"), ErrorCode::kForeign);
  EXPECT_EQ(code_of(dir / "a.png"), ErrorCode::kForeign);
  try {
    Reader reader(dir / "a.png");
  } catch (const Error& e) {
    EXPECT_THAT(e.message(), testing::HasSubstr("is not an apgm file: starts with 89 50 4e 47 (PNG image)"));
  }
}

TEST(ReaderTest, ReadsAPipe) {
  TempDir dir;
  const Map map = sample_map(11);
  write_map(map, dir / "a.apgm");
  const std::string fifo = dir / "fifo";
  ASSERT_EQ(std::system(("mkfifo '" + fifo + "'").c_str()), 0);
  std::thread feeder(
      [&] { (void)!std::system(("cat '" + (dir / "a.apgm") + "' > '" + fifo + "'").c_str()); });
  EXPECT_TRUE(test::same_map(map, test::read_map(fifo)));
  feeder.join();
}

}  // namespace
}  // namespace apgm
