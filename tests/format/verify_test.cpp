#include "apgm/format/verify.hpp"

#include <gmock/gmock.h>

#include "apgm/core/error.hpp"
#include "file_parts.hpp"
#include "input_file.hpp"
#include "sample_map.hpp"
#include "scan.hpp"
#include "temp_dir.hpp"

namespace apgm {
namespace {

using format::Kind;
using testing::HasSubstr;
using namespace test;

class VerifyTest : public testing::Test {
 protected:
  void SetUp() override {
    write_map(sample_map(21, 6, 4), dir_ / "good.apgm");
    good_ = read_file(dir_ / "good.apgm");
  }
  VerifyReport verify_bytes(const std::string& bytes, const VerifyOptions& options = {}) {
    return verify(std::as_bytes(std::span(bytes)), options);
  }
  ErrorCode refused(const std::string& bytes) {
    try {
      verify_bytes(bytes);
    } catch (const Error& e) {
      return e.code();
    }
    ADD_FAILURE() << "not refused";
    return ErrorCode::kCancelled;
  }

  TempDir dir_;
  std::string good_;
};

TEST_F(VerifyTest, GoodFileIsValid) {
  const VerifyReport report = verify(dir_ / "good.apgm");
  EXPECT_TRUE(report.valid());
  const Reader reader(dir_ / "good.apgm");
  EXPECT_EQ(report.content_id, reader.content_id());
  EXPECT_EQ(report.blocks, blocks_of(good_).size());
  EXPECT_EQ(report.commits, 1u);
  EXPECT_EQ(report.decoded_layers, 0u);
  EXPECT_EQ(report.file_bytes, good_.size());
}

TEST_F(VerifyTest, DeepDecodesEveryLayerOnAnyNumberOfThreads) {
  for (const int threads : {1, 2, 0}) {
    VerifyOptions options;
    options.deep = true;
    options.threads = threads;
    const VerifyReport report = verify(dir_ / "good.apgm", options);
    EXPECT_TRUE(report.valid());
    EXPECT_EQ(report.decoded_layers, report.layers);
  }
}

TEST_F(VerifyTest, EverySingleBitFlipIsFound) {
  std::size_t silent = 0;
  for (std::size_t byte = 0; byte < good_.size(); ++byte) {
    try {
      silent += verify_bytes(flipped(good_, byte, static_cast<int>(byte % 8))).valid();
    } catch (const Error& e) {
      EXPECT_TRUE(e.code() == ErrorCode::kForeign || e.code() == ErrorCode::kUnsupported) << e.message();
    }
  }
  EXPECT_EQ(silent, 0u) << "of " << good_.size();
}

TEST_F(VerifyTest, NamesEveryDamagedLayerOnce) {
  std::string bad = good_;
  std::size_t damaged = 0;
  for (const BlockAt& block : blocks_of(good_)) {
    if (block.header.kind != Kind::kLayer) continue;
    bad = flipped(bad, block.offset + (damaged % 2 == 0 ? 80 : 20), 1);  // payload, header
    ++damaged;
  }
  const VerifyReport report = verify_bytes(bad);
  EXPECT_EQ(report.problem_count, damaged);
  ASSERT_EQ(report.problems.size(), damaged);
  for (const Problem& p : report.problems) {
    EXPECT_TRUE(p.patch.has_value()) << p.text;
    EXPECT_NE(p.layer, "") << p.text;
    EXPECT_THAT(p.text, HasSubstr("patch ("));
  }
}

TEST_F(VerifyTest, ListIsBoundedAndTheCountIsNot) {
  VerifyOptions options;
  options.max_problems = 2;
  std::string bad = good_;
  std::size_t damaged = 0;
  for (const BlockAt& block : blocks_of(good_)) {
    if (block.header.kind == Kind::kLayer) bad = flipped(bad, block.offset + 70), ++damaged;
  }
  const VerifyReport report = verify_bytes(bad, options);
  EXPECT_EQ(report.problem_count, damaged);
  EXPECT_EQ(report.problems.size(), 2u);
}

TEST_F(VerifyTest, DamagedRootStillChecksTheLayers) {
  const BlockAt root = first_of(good_, Kind::kIndexRoot), layer = first_of(good_, Kind::kLayer);
  const VerifyReport report = verify_bytes(flipped(flipped(good_, root.offset + 70), layer.offset + 70));
  ASSERT_EQ(report.problem_count, 2u);
  EXPECT_EQ(report.problems[0].offset, layer.offset);
  EXPECT_TRUE(report.problems[0].patch.has_value());
  EXPECT_EQ(report.problems[1].text, "the index root: a block fails its checksum");
}

TEST_F(VerifyTest, TruncationIsReportedWithWhatIsLeft) {
  for (std::size_t size = sizeof(format::Preamble); size < good_.size(); size += 7) {
    const VerifyReport report = verify_bytes(good_.substr(0, size));
    EXPECT_FALSE(report.valid()) << size;
    EXPECT_EQ(report.content_id, "");
  }
}

TEST_F(VerifyTest, BytesThatWerePutInAreOneFault) {
  const BlockAt layer = first_of(good_, Kind::kLayer);
  std::string bad = good_;
  bad.insert(layer.offset, "xyz");
  EXPECT_FALSE(verify_bytes(bad).valid());
}

TEST_F(VerifyTest, ForeignAndUnsupportedAreNotDamaged) {
  EXPECT_EQ(refused("# Octomap OcTree"), ErrorCode::kForeign);
  EXPECT_EQ(refused(""), ErrorCode::kForeign);
  std::string stream = good_;
  stream[12] = 1;
  const auto hash = format::hash_of(std::as_bytes(std::span(stream)).first(56));
  std::memcpy(stream.data() + 56, &hash, 8);
  EXPECT_EQ(refused(stream), ErrorCode::kUnsupported);
}

TEST_F(VerifyTest, MemoryBoundIsKept) {
  VerifyOptions options;
  options.max_memory_bytes = 100;
  EXPECT_THROW(verify(dir_ / "good.apgm", options), Error);
}

TEST_F(VerifyTest, CancelEnds) {
  const std::atomic<bool> cancel{true};
  VerifyOptions options;
  options.cancel = &cancel;
  try {
    verify(dir_ / "good.apgm", options);
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kCancelled);
  }
}

TEST(PatchOfKeyTest, UndoesTheCurve) {
  std::mt19937_64 rng(5);
  for (int i = 0; i < 1000; ++i) {
    const PatchIndex p{static_cast<std::int32_t>(rng()), static_cast<std::int32_t>(rng())};
    EXPECT_EQ(format::patch_of_key(curve_key(p)), p);
  }
}

/// Spots follow each other without gaps, whatever the bytes are.
TEST(BlockScanTest, CoversEveryByteOfNoise) {
  std::mt19937_64 rng(11);
  for (int round = 0; round < 50; ++round) {
    SCOPED_TRACE(round);
    std::string file;
    while (file.size() < 600'000) {
      std::vector<std::byte> block;
      const std::vector<std::byte> body(rng() % (round % 2 == 0 ? 400'000 : 900), std::byte(rng()));
      format::append_block(block, Kind::kLayer, rng(), {}, body);
      file.append(reinterpret_cast<const char*>(block.data()), block.size());
      if (rng() % 3 == 0) file.append(rng() % 100, static_cast<char>(rng()));
      if (rng() % 5 == 0) file += "APGMBLK1";
    }
    for (int i = 0; i < 5; ++i) file = flipped(std::move(file), rng() % file.size());
    const format::InputFile input(std::as_bytes(std::span(file)), "noise");
    format::BlockScan scan(input, 0, file.size());
    format::Spot spot;
    std::size_t at = 0;
    while (scan.next(spot)) {
      ASSERT_EQ(spot.offset, at);
      ASSERT_GT(spot.bytes, 0u);
      if (spot.state == format::Spot::State::kWhole && spot.payload.size() == spot.header.payload_bytes) {
        EXPECT_EQ(format::hash_of(spot.payload), spot.header.payload_hash);
      }
      at += spot.bytes;
    }
    EXPECT_EQ(at, file.size());
  }
}

/// Headers within headers, each said to reach to the end: without a bound, time by the square.
TEST(BlockScanTest, NestedHeadersCostLinearTime) {
  std::string file;
  const std::size_t n = 200'000;
  for (std::size_t i = 0; i < n; ++i) {
    format::BlockHeader h;
    h.payload_bytes = (n - i - 1) * sizeof(h) + 8;
    h.hash = format::hash_of(format::bytes_of(h).first(56));
    file.append(reinterpret_cast<const char*>(&h), sizeof(h));
  }
  file += "12345678 and a bit more";
  const format::InputFile input(std::as_bytes(std::span(file)), "nested");
  format::BlockScan scan(input, 0, file.size());
  format::Spot spot;
  std::size_t spots = 0;
  while (scan.next(spot)) ++spots;
  EXPECT_LT(spots, 10u);
}

}  // namespace
}  // namespace apgm
