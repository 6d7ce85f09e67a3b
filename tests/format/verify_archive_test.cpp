// Verification and recovery over the commits of an archive.

#include <gmock/gmock.h>

#include "apgm/core/error.hpp"
#include "apgm/format/recover.hpp"
#include "apgm/format/verify.hpp"
#include "archive_support.hpp"
#include "file_parts.hpp"
#include "temp_dir.hpp"

namespace apgm {
namespace {

using format::Kind;
using testing::HasSubstr;
using namespace test;

class VerifyArchiveTest : public testing::Test {
 protected:
  void SetUp() override {
    std::mt19937_64 rng(9);
    Map empty(MapHeader{});
    maps_.push_back(sample_map(31, 5, 3));
    commit_map(dir_ / "a.apgm", empty, maps_[0]);
    while (maps_.size() < 4) {
      sizes_.push_back(read_file(dir_ / "a.apgm").size());
      maps_.push_back(changed_map(maps_.back(), rng, 3));
      commit_map(dir_ / "a.apgm", maps_[maps_.size() - 2], maps_.back(), {"next", {}});
    }
    tag_commit(dir_ / "a.apgm", "first", 1);
    good_ = read_file(dir_ / "a.apgm");
  }

  static VerifyReport verified(const std::string& bytes) {
    VerifyOptions options;
    options.deep = true;
    options.threads = 1;
    return verify(std::as_bytes(std::span(bytes)), options);
  }
  /// What is recovered, and what is told of it.
  Map recovered(const std::string& bytes) {
    const Recovery recovery(std::as_bytes(std::span(bytes)));
    report_ = recovery.report();
    Map map(recovery.header());
    MapSink sink(map);
    stream(recovery, sink);
    return map;
  }
  std::vector<BlockAt> blocks(Kind kind) const {
    std::vector<BlockAt> all = blocks_of(good_);
    std::erase_if(all, [&](const BlockAt& b) { return b.header.kind != kind; });
    return all;
  }

  TempDir dir_;
  std::vector<Map> maps_;
  std::vector<std::size_t> sizes_;  // of the archive before each commit but the first
  std::string good_;
  RecoverReport report_;
};

TEST_F(VerifyArchiveTest, GoodArchiveIsValid) {
  const VerifyReport report = verified(good_);
  EXPECT_TRUE(report.valid()) << report.problems[0].text;
  EXPECT_TRUE(report.archive);
  EXPECT_EQ(report.commits, 4u);
  EXPECT_GE(report.decoded_layers, report.layers);
}

TEST_F(VerifyArchiveTest, EverySingleBitFlipIsFoundInAllCommits) {
  std::size_t silent = 0;
  for (std::size_t byte = 0; byte < good_.size(); ++byte) {
    try {
      const std::string bad = flipped(good_, byte, static_cast<int>(byte % 8));
      silent += verify(std::as_bytes(std::span(bad))).valid();
    } catch (const Error& e) {
      EXPECT_TRUE(e.code() == ErrorCode::kForeign || e.code() == ErrorCode::kUnsupported) << e.message();
    }
  }
  EXPECT_EQ(silent, 0u) << "of " << good_.size();
}

TEST_F(VerifyArchiveTest, TruncationIsTornOrFoundUnlessItIsAnEarlierState) {
  for (std::size_t size = 100; size < good_.size(); size += 5) {
    const VerifyReport report = verified(good_.substr(0, size));
    const bool was_state = std::ranges::find(sizes_, size) != sizes_.end();
    EXPECT_EQ(report.valid(), was_state) << size;
    const bool torn = report.problem_count == 0 && report.uncommitted_bytes > 0;
    EXPECT_TRUE(size <= sizes_[0] || was_state || torn || report.problem_count > 0) << size;
  }
}

TEST_F(VerifyArchiveTest, TornTailIsNoDamageAndRecoversToTheLastCommit) {
  const std::string torn = good_ + good_.substr(sizes_[1], 300);
  const VerifyReport report = verified(torn);
  EXPECT_FALSE(report.valid());
  EXPECT_EQ(report.problem_count, 0u) << report.problems[0].text;
  EXPECT_EQ(report.uncommitted_bytes, 300u);
  EXPECT_TRUE(same_content(recovered(torn), maps_.back()));
  EXPECT_EQ(report_.loss_count, 0u);
  EXPECT_EQ(report_.uncommitted_bytes, 300u);
}

TEST_F(VerifyArchiveTest, RecoversTheLastCommitWithoutItsFooters) {
  std::string bad = good_;
  for (const BlockAt& block : blocks(Kind::kFooter)) bad = zeroed(bad, block.offset, block.bytes);
  EXPECT_TRUE(same_content(recovered(bad), maps_.back()));
  EXPECT_EQ(report_.loss_count, 0u);
  EXPECT_EQ(report_.commit, 4u);
  EXPECT_TRUE(report_.index);
}

TEST_F(VerifyArchiveTest, RecoveredHeaderHoldsNothingOfTheArchive) {
  const Map map = recovered(good_);
  for (const auto& [key, value] : map.header().metadata)
    EXPECT_FALSE(key.starts_with("apgm.archive.")) << key;
}

TEST_F(VerifyArchiveTest, AnOlderIndexAndNewerLayersMakeTheLastCommit) {
  const BlockAt root = blocks(Kind::kIndexRoot).back();
  const Map map = recovered(zeroed(good_, root.offset, root.bytes));
  EXPECT_FALSE(report_.index);
  // Layers that the last commit dropped cannot be told from those it kept, unless it dropped none.
  for (const auto& [key, patch] : maps_.back().by_key()) {
    for (const auto& [type, layer] : patch.layers) {
      EXPECT_TRUE(same_layer(&layer, named_layer(map, patch.index, maps_.back().header().types[type])));
    }
  }
}

TEST_F(VerifyArchiveTest, AnOlderStateStandsInForALostLayerAndIsListed) {
  Map next = maps_.back();
  const auto& [index, layers] =
      std::pair(next.by_key().begin()->second.index, next.by_key().begin()->second.layers);
  const TypeId type = layers.begin()->first;
  next.layer(index, type, 0).stamp_ns += 5;
  commit_map(dir_ / "a.apgm", maps_.back(), next);
  const std::string file = read_file(dir_ / "a.apgm");
  std::string bad = file;
  for (const BlockAt& block : blocks_of(file)) {
    if (block.header.kind == Kind::kLayer && block.header.commit == 5)
      bad = zeroed(bad, block.offset, block.bytes);
  }
  EXPECT_TRUE(same_content(recovered(bad), maps_.back()));
  ASSERT_EQ(report_.loss_count, 1u);
  EXPECT_THAT(report_.losses[0].text, HasSubstr("its state of commit"));
}

}  // namespace
}  // namespace apgm
