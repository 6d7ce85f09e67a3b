#include "apgm/format/writer.hpp"

#include <gmock/gmock.h>

#include "apgm/core/error.hpp"
#include "sample_map.hpp"
#include "temp_dir.hpp"

namespace apgm {
namespace {

using test::sample_map;
using test::TempDir;
using test::write_map;

TEST(WriterTest, SameMapGivesSameBytes) {
  TempDir dir;
  write_map(sample_map(1), dir / "a.apgm");
  write_map(sample_map(1), dir / "b.apgm");
  EXPECT_EQ(test::read_file(dir / "a.apgm"), test::read_file(dir / "b.apgm"));
}

TEST(WriterTest, ContentIdIsEqualAtAnyLevelAndDiffersForAnotherMap) {
  TempDir dir;
  WriterOptions strong;
  strong.level = 12;
  const auto a = write_map(sample_map(2), dir / "a.apgm");
  const auto b = write_map(sample_map(2), dir / "b.apgm", strong);
  const auto c = write_map(sample_map(3), dir / "c.apgm");
  EXPECT_EQ(a.content_id, b.content_id);
  EXPECT_NE(a.content_id, c.content_id);
  EXPECT_EQ(a.content_id.size(), 32u);
}

TEST(WriterTest, StampsAndUnusedTypesAreNotPartOfTheContentId) {
  TempDir dir;
  Map plain = sample_map(4);
  MapHeader wider = plain.header();
  wider.types =
      TypeTable({LayerType::occupancy(), LayerType::semantic("semantic", {"Road", "Marking", "Blocked"}),
                 LayerType::real("velocity", {"vx", "vy"}), LayerType::real("zzz", {"z"})});
  Map other(wider);
  for (const auto& [key, patch] : plain.by_key()) {
    for (const auto& [type, layer] : patch.layers) {
      other.patch(patch.index).layers.emplace(type, layer).first->second.stamp_ns = 77;
    }
  }
  EXPECT_EQ(write_map(plain, dir / "a.apgm").content_id, write_map(other, dir / "b.apgm").content_id);
}

TEST(WriterTest, FrameIsPartOfTheContentId) {
  TempDir dir;
  MapHeader moved = sample_map(1).header();
  moved.frame.datum_y_um += 1;
  EXPECT_NE(write_map(Map(moved), dir / "a.apgm").content_id,
            write_map(Map(sample_map(1).header()), dir / "b.apgm").content_id);
}

TEST(WriterTest, DropsVacuousLayersAndPatches) {
  TempDir dir;
  Map map(sample_map(1).header());
  map.layer({0, 0}, 0, 4);
  map.layer({1, 0}, 0, 2).plane(0)[3] = 0.5f;
  const auto report = write_map(map, dir / "a.apgm");
  EXPECT_EQ(report.patches, 1u);
  EXPECT_EQ(report.layers, 1u);
}

TEST(WriterTest, RefusesMassesOutOfRangeAndLeavesNothing) {
  TempDir dir;
  for (const float bad :
       {1.5f, -0.1f, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    Map map(sample_map(1).header());
    map.layer({0, 0}, 0, 2).plane(0)[1] = bad;
    EXPECT_THROW(write_map(map, dir / "a.apgm"), Error) << bad;
  }
  Map sum(sample_map(1).header());
  sum.layer({0, 0}, 0, 2).plane(0)[1] = 0.6f;
  sum.layer({0, 0}, 0, 2).plane(1)[1] = 0.6f;
  EXPECT_THROW(write_map(sum, dir / "a.apgm"), Error);
  EXPECT_TRUE(dir.list().empty());
}

TEST(WriterTest, MinusZeroIsStoredAsZero) {
  TempDir dir;
  Map plain(sample_map(1).header()), minus(sample_map(1).header());
  plain.layer({0, 0}, 0, 1).plane(0)[0] = 0.5f;
  minus.layer({0, 0}, 0, 1).plane(0)[0] = 0.5f;
  minus.layer({0, 0}, 0, 1).plane(1)[0] = -0.0f;
  EXPECT_EQ(write_map(plain, dir / "a.apgm").content_id, write_map(minus, dir / "b.apgm").content_id);
}

TEST(WriterTest, RefusesALevelOutOfRange) {
  TempDir dir;
  WriterOptions options;
  options.level = 20;
  EXPECT_THROW(Writer(dir / "a.apgm", sample_map(1).header(), options), Error);
}

TEST(WriterTest, RefusesAHeaderItCannotHoldBeforeTouchingTheDisk) {
  TempDir dir;
  MapHeader header = sample_map(1).header();
  for (int i = 0; i < 1025; ++i) header.metadata["key" + std::to_string(i)] = "v";
  EXPECT_THROW(Writer(dir / "a.apgm", header), Error);
  EXPECT_TRUE(dir.list().empty());
}

TEST(WriterTest, UnfinishedFileLeavesNothing) {
  TempDir dir;
  { Writer writer(dir / "a.apgm", sample_map(1).header()); }
  EXPECT_TRUE(dir.list().empty());
}

class LossyTest : public testing::TestWithParam<std::pair<Lossy, float>> {};

TEST_P(LossyTest, StaysWithinItsBoundAndValid) {
  const auto [lossy, bound] = GetParam();
  TempDir dir;
  const Map map = sample_map(7, 8);
  WriterOptions options;
  options.lossy = lossy;
  write_map(map, dir / "a.apgm", options);
  const Map back = test::read_map(dir / "a.apgm");
  for (const auto& [key, patch] : map.by_key()) {
    for (const auto& [type, layer] : patch.layers) {
      const Layer* got = back.find(patch.index, type);
      if (!map.header().types[type].is_evidence()) {
        ASSERT_TRUE(got != nullptr && same_cells(*got, layer));
        continue;
      }
      for (int c = 0; c < layer.channels(); ++c) {
        for (std::size_t i = 0; i < layer.cells(); ++i) {
          const float value = got == nullptr ? map.header().types[type].background(c) : got->plane(c)[i];
          ASSERT_LE(std::fabs(value - layer.plane(c)[i]), bound * 1.0001f);
        }
      }
      if (got != nullptr) {
        EXPECT_TRUE(is_canonical(*got, map.header().types[type]));
      }
    }
  }
}

TEST_P(LossyTest, IsIdempotentAndSmaller) {
  TempDir dir;
  WriterOptions options;
  options.lossy = GetParam().first;
  const Map map = sample_map(8, 12, 6);
  const auto exact = write_map(map, dir / "exact.apgm");
  const auto once = write_map(map, dir / "once.apgm", options);
  const auto twice = write_map(test::read_map(dir / "once.apgm"), dir / "twice.apgm", options);
  EXPECT_EQ(once.content_id, twice.content_id);
  EXPECT_LT(once.file_bytes, exact.file_bytes);
}

TEST_P(LossyTest, BoundStaysWithTheLayersThatAreWrittenAgain) {
  const auto [lossy, bound] = GetParam();
  TempDir dir;
  WriterOptions options;
  options.lossy = lossy;
  write_map(sample_map(9, 4), dir / "once.apgm", options);
  WriterOptions stronger;
  stronger.level = 9;
  write_map(Reader(dir / "once.apgm"), dir / "again.apgm", stronger);
  const Reader again(dir / "again.apgm");
  const auto cursor = again.patches();
  PatchInfo patch;
  StoredLayer stored;
  while (cursor->next(patch)) {
    for (const LayerInfo& info : patch.layers) {
      again.load_stored(info, stored);
      EXPECT_EQ(stored.error_bound, again.header().types[info.type].is_evidence() ? bound : 0.0f);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, LossyTest,
                         testing::Values(std::pair{Lossy::kU16, 1.0f / 65535},
                                         std::pair{Lossy::kU8, 1.0f / 255}));

}  // namespace
}  // namespace apgm
