// Promise 1 of the format: no silent corruption. Every fault is tried, and counted.

#include <gmock/gmock.h>

#include "apgm/core/error.hpp"
#include "block.hpp"
#include "sample_map.hpp"
#include "temp_dir.hpp"

namespace apgm {
namespace {

using test::sample_map;
using test::TempDir;

class DamageTest : public testing::Test {
 protected:
  void SetUp() override {
    test::write_map(sample_map(21, 3, 3), dir_ / "good.apgm");
    good_ = test::read_file(dir_ / "good.apgm");
  }

  /// Error of reading all of a file with these bytes; nullopt: it was read.
  std::optional<Error> read_bytes(const std::string& bytes) {
    test::write_file(dir_ / "bad.apgm", bytes);
    try {
      test::read_map(dir_ / "bad.apgm");
      return {};
    } catch (const Error& e) {
      return e;
    }
  }

  TempDir dir_;
  std::string good_;
};

TEST_F(DamageTest, GoodFileReads) { EXPECT_FALSE(read_bytes(good_)); }

TEST_F(DamageTest, EverySingleBitFlipIsReported) {
  std::size_t silent = 0;
  for (std::size_t byte = 0; byte < good_.size(); ++byte) {
    for (int bit = 0; bit < 8; ++bit) {
      std::string bad = good_;
      bad[byte] = static_cast<char>(bad[byte] ^ (1 << bit));
      silent += !read_bytes(bad);
    }
  }
  EXPECT_EQ(silent, 0u) << "of " << good_.size() * 8;
}

TEST_F(DamageTest, EveryTruncationIsReported) {
  std::size_t silent = 0;
  for (std::size_t size = 0; size < good_.size(); ++size) silent += !read_bytes(good_.substr(0, size));
  EXPECT_EQ(silent, 0u);
}

TEST_F(DamageTest, EveryAppendedTailIsReported) {
  EXPECT_TRUE(read_bytes(good_ + std::string(1, '\0')));
  EXPECT_TRUE(read_bytes(good_ + std::string(4096, '\0')));
  EXPECT_TRUE(read_bytes(good_ + good_));
}

TEST_F(DamageTest, ZeroedAndSwappedRunsAreReported) {
  const std::size_t run = 64;
  std::size_t silent = 0, tried = 0;
  for (std::size_t a = 0; a + run <= good_.size(); a += run) {
    std::string zeroed = good_;
    zeroed.replace(a, run, run, '\0');
    if (zeroed != good_) silent += (++tried, !read_bytes(zeroed));
    for (std::size_t b = a + run; b + run <= good_.size(); b += 5 * run) {
      std::string swapped = good_;
      swapped.replace(a, run, good_.substr(b, run));
      swapped.replace(b, run, good_.substr(a, run));
      if (swapped != good_) silent += (++tried, !read_bytes(swapped));
    }
  }
  EXPECT_EQ(silent, 0u) << "of " << tried;
}

TEST_F(DamageTest, NewerMajorVersionIsUnsupportedNotDamaged) {
  std::string newer = good_;
  newer[8] = 2;
  const auto hash = format::hash_of(std::as_bytes(std::span(newer)).first(56));
  std::memcpy(newer.data() + 56, &hash, 8);
  const auto error = read_bytes(newer);
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), ErrorCode::kUnsupported);
  EXPECT_THAT(error->message(), testing::HasSubstr("is of format 2.0"));
}

TEST_F(DamageTest, UnknownFeatureBitIsUnsupported) {
  std::string newer = good_;
  newer[12] = 4;
  const auto hash = format::hash_of(std::as_bytes(std::span(newer)).first(56));
  std::memcpy(newer.data() + 56, &hash, 8);
  const auto error = read_bytes(newer);
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), ErrorCode::kUnsupported);
}

TEST_F(DamageTest, NamesThePatchTheLayerAndTheByte) {
  // A byte in the middle of the first layer's block: after the preamble and the map header.
  const auto header = format::read_as<format::BlockHeader>(std::as_bytes(std::span(good_)).subspan(64));
  const std::size_t layer_at = 64 + 64 + format::padded(header.payload_bytes);
  std::string bad = good_;
  bad[layer_at + 70] = static_cast<char>(bad[layer_at + 70] ^ 1);
  const auto error = read_bytes(bad);
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), ErrorCode::kDamaged);
  EXPECT_THAT(
      error->message(),
      testing::ContainsRegex("patch \\(-?[0-9]+,-?[0-9]+\\) layer '[a-z]+': a block fails its checksum"));
  EXPECT_EQ(error->offset_bytes(), layer_at);
}

}  // namespace
}  // namespace apgm
