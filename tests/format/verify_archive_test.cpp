// Verification and recovery over the commits of an archive.

#include <gmock/gmock.h>

#include <chrono>
#include <functional>
#include <set>

#include "apgm/core/error.hpp"
#include "apgm/format/recover.hpp"
#include "apgm/format/verify.hpp"
#include "archive_support.hpp"
#include "content_id.hpp"
#include "file_parts.hpp"
#include "footer.hpp"
#include "map_header.hpp"
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

  /// The archive with its last header replaced, however the rules are broken by it.
  static std::string replaced(std::string file,
                              const std::function<void(MapHeader&, format::Footer&)>& edit) {
    const auto text = [](const std::vector<std::byte>& bytes) {
      return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    };
    const std::size_t at = file.size() - format::kFooterBlockBytes;
    const auto all = std::as_bytes(std::span(file));
    format::Footer footer = format::parse_footer(all.subspan(at), at).footer;
    MapHeader header = format::read_map_header(all.subspan(footer.header_offset, footer.header_bytes));
    footer.previous_footer = at;
    footer.header_offset = file.size();
    edit(header, footer);
    std::vector<std::byte> block;
    footer.header_hash = format::append_map_header(block, header, footer.commits).payload_hash;
    footer.header_bytes = block.size();
    file += text(block);
    footer.file_bytes = file.size() + format::kFooterBlockBytes;
    block.clear();
    format::append_block(block, Kind::kFooter, 0, {}, format::bytes_of(footer), footer.commits);
    return file + text(block);
  }
  /// The text of the one problem of a replaced header.
  std::string problem_of(const std::function<void(MapHeader&, format::Footer&)>& edit) const {
    const VerifyReport report = verified(replaced(good_, edit));
    EXPECT_EQ(report.problem_count, 1u);
    return report.problems.empty() ? "" : report.problems[0].text;
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
  EXPECT_EQ(report_.older_commits, 0u) << "only those that can still be read count";
  EXPECT_TRUE(report_.index);
}

TEST_F(VerifyArchiveTest, OlderCommitsAreCountedOnceWhateverTheirTags) {
  (void)recovered(good_);
  EXPECT_EQ(report_.commit, 4u);
  EXPECT_EQ(report_.older_commits, 3u);
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

TEST_F(VerifyArchiveTest, GapsInTheNumbersAreNoDamage) {
  compact_archive(dir_ / "a.apgm", {.keep = 2});  // and commit 1, which has a tag
  const VerifyReport report = verified(read_file(dir_ / "a.apgm"));
  EXPECT_TRUE(report.valid()) << report.problems[0].text;
  EXPECT_EQ(report.commits, 3u);
}

TEST_F(VerifyArchiveTest, AReplacedHeaderMayHaveOtherMetadataAlone) {
  const auto edit = [](MapHeader& header, format::Footer&) { header.metadata["site"] = "elsewhere"; };
  const VerifyReport report = verified(replaced(good_, edit));
  EXPECT_TRUE(report.valid()) << report.problems[0].text;
  EXPECT_EQ(report.commits, 4u);
}

TEST_F(VerifyArchiveTest, AnotherFrameIsFound) {
  const VerifyReport report =
      verified(replaced(good_, [](MapHeader& h, format::Footer&) { ++h.frame.datum_x_um; }));
  EXPECT_FALSE(report.valid());
  EXPECT_TRUE(std::ranges::any_of(report.problems, [](const Problem& p) {
    return p.text.find("its frame is not that of the newest commit") != std::string::npos;
  }));
}

TEST_F(VerifyArchiveTest, AReplacedHeaderKeepsTheMap) {
  const format::Footer first = [&] {
    const std::size_t at = blocks(Kind::kFooter)[0].offset;
    return format::parse_footer(std::as_bytes(std::span(good_)).subspan(at, format::kFooterBlockBytes), at)
        .footer;
  }();
  const VerifyReport report = verified(replaced(good_, [&](MapHeader&, format::Footer& f) {
    f.root_offset = first.root_offset;
    f.root_bytes = first.root_bytes;
    f.root_hash = first.root_hash;
  }));
  EXPECT_TRUE(std::ranges::any_of(report.problems, [](const Problem& p) {
    return p.text == "the footer of a replaced header names another map than the one before";
  }));
}

TEST_F(VerifyArchiveTest, TagsAreParsedAndNameCommits) {
  const auto tags = [](const char* text) {
    return [=](MapHeader& header, format::Footer&) { header.metadata["apgm.archive.tags"] = text; };
  };
  EXPECT_TRUE(verified(replaced(good_, tags("a=2 b=4"))).valid());
  EXPECT_THAT(problem_of(tags("b=2 a=4")), HasSubstr("the list of tags is malformed"));
  EXPECT_EQ(problem_of(tags("a=2 b=5")), "tag 'b' names a commit that does not exist");
}

TEST_F(VerifyArchiveTest, ManyFootersOfOneIndexCostHardlyMoreThanOne) {
  Map map = empty_map();
  MapHeader header = map.header();
  header.types = TypeTable({LayerType::occupancy()});
  map = Map(header);
  for (int i = 0; i < 6000; ++i) map.layer({i % 80, i / 80}, 0, 0).plane(0)[0] = 0.5f;
  commit_map(dir_ / "wide.apgm", Map(header), map);
  const std::string one = read_file(dir_ / "wide.apgm");
  std::string many = one;
  for (int i = 0; i < 200; ++i) many = replaced(std::move(many), [](MapHeader&, format::Footer&) {});
  const auto seconds = [](const std::string& file) {
    const auto start = std::chrono::steady_clock::now();
    EXPECT_TRUE(verified(file).valid());
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  seconds(one);
  EXPECT_LT(seconds(many), 20 * seconds(one) + 0.05);
}

TEST_F(VerifyArchiveTest, DeepWithinABudgetThatHoldsNoLayerIsALimitAndNoDamage) {
  MapHeader header = empty_map().header();
  header.types = TypeTable({LayerType::occupancy()});
  Map map(header);
  for (int i = 0; i < 4; ++i) map.layer({i, 0}, 0, 9).plane(0)[i] = 0.5f;
  commit_map(dir_ / "fine.apgm", Map(header), map);
  VerifyOptions options;
  options.deep = true;
  options.max_memory_bytes = std::uint64_t{4} << 20;
  RecoverOptions recovering;
  recovering.max_memory_bytes = options.max_memory_bytes;
  for (const bool recover : {false, true}) {
    try {
      if (recover) {
        const Recovery recovery(dir_ / "fine.apgm", recovering);
      } else {
        verify(dir_ / "fine.apgm", options);
      }
      ADD_FAILURE();
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::kLimit);
      EXPECT_EQ(e.message(), "the memory budget does not hold the largest layer while it is decoded");
      EXPECT_THAT(e.hint(), HasSubstr("allow at least "));
    }
  }
  options.max_memory_bytes = recovering.max_memory_bytes = std::uint64_t{16} << 20;
  EXPECT_TRUE(verify(dir_ / "fine.apgm", options).valid());
  EXPECT_EQ(Recovery(dir_ / "fine.apgm", recovering).report().layers, 4u);
}

TEST_F(VerifyArchiveTest, LayersBehindTheLastFooterAreALoss) {
  const BlockAt last = blocks(Kind::kFooter)[3];
  const std::string torn = zeroed(good_.substr(0, last.offset + last.bytes), last.offset, last.bytes);
  EXPECT_GT(verified(torn).uncommitted_bytes, 0u);
  EXPECT_TRUE(same_content(recovered(torn), maps_[2]));
  const auto layers =
      std::ranges::count_if(blocks(Kind::kLayer), [&](const BlockAt& b) { return b.header.commit == 4; });
  EXPECT_EQ(report_.uncommitted_layers, static_cast<std::uint64_t>(layers));
  ASSERT_EQ(report_.loss_count, 1u);
  EXPECT_EQ(report_.losses[0].text, "a commit that was not finished, " + std::to_string(layers) +
                                        (layers == 1 ? " layer" : " layers") + ", is left out");
  EXPECT_EQ(report_.losses[0].offset, blocks(Kind::kFooter)[2].offset + format::kFooterBlockBytes);
}

/// Numbers of types count in the table of their commit, however many commits came after it.
TEST_F(VerifyArchiveTest, TypesOfOldCommitsAreKnownAfterMany) {
  MapHeader header = empty_map().header();
  header.types = TypeTable({LayerType::occupancy("b")});
  Map map(header);
  map.layer({0, 0}, 0, 1).plane(0)[1] = 0.5f;
  commit_map(dir_ / "long.apgm", Map(header), map);
  header.types = TypeTable({LayerType::occupancy("a"), LayerType::occupancy("b")});
  Map next(header);
  next.layer({0, 0}, 1, 1) = *map.find({0, 0}, 0);
  commit_map(dir_ / "long.apgm", map, next);
  for (int i = 0; i < 70; ++i) {
    const Map before = next;
    next.layer({5, 5}, 0, 0).plane(0)[0] = 0.25f + 0.005f * static_cast<float>(i);
    commit_map(dir_ / "long.apgm", before, next);
  }
  std::string bad = read_file(dir_ / "long.apgm");
  for (const BlockAt& block : blocks_of(bad)) {
    const bool index = block.header.kind == Kind::kIndexRoot || block.header.kind == Kind::kIndexPage;
    const bool layer = block.header.kind == Kind::kLayer && block.header.commit == 2;
    if (index || layer) bad = zeroed(bad, block.offset, block.bytes);
  }
  EXPECT_TRUE(same_content(recovered(bad), next));
}

TEST_F(VerifyArchiveTest, CommitsWithEqualHeadersAreRecoveredWithoutALoss) {
  const Map map = sample_map(31, 5, 3);
  commit_map(dir_ / "twice.apgm", Map(MapHeader{}), map);
  commit_map(dir_ / "twice.apgm", map, map);
  recovered(read_file(dir_ / "twice.apgm"));
  EXPECT_EQ(report_.commit, 2u);
  EXPECT_EQ(report_.loss_count, 0u) << report_.losses[0].text;
}

// Pages of another archive, whose commits have other numbers, and of a map.
TEST_F(VerifyArchiveTest, PagesOfAnotherFileBringNoLayer) {
  std::set<std::uint64_t> own;
  for (const Map& map : maps_) {
    for (const auto& [key, patch] : map.by_key()) {
      for (const auto& [type, layer] : patch.layers) own.insert(format::content_hash(layer));
    }
  }
  std::mt19937_64 rng(10);
  std::vector<Map> maps{Map(MapHeader{}), sample_map(41, 9, 4)};
  commit_map(dir_ / "b.apgm", maps[0], maps[1]);
  for (int i = 0; i < 9; ++i) {
    maps.push_back(changed_map(maps.back(), rng, 3));
    commit_map(dir_ / "b.apgm", maps[maps.size() - 2], maps.back());
  }
  write_map(sample_map(42, 9, 4), dir_ / "c.apgm");
  constexpr std::size_t kPage = 2048;
  for (const std::string other : {"b.apgm", "c.apgm"}) {
    const std::string pages = read_file(dir_ / other);
    for (std::size_t to = kPage; to + kPage < good_.size(); to += kPage) {
      for (std::size_t from = 0; from + kPage <= pages.size(); from += kPage) {
        SCOPED_TRACE(other + " page " + std::to_string(from) + " at " + std::to_string(to));
        std::string bad = good_;
        bad.replace(to, kPage, pages, from, kPage);
        const Recovery recovery(std::as_bytes(std::span(bad)));
        EXPECT_EQ(recovery.report().commit, 4u);
        std::string told;
        for (const Loss& loss : recovery.report().losses) told += loss.text + "\n";
        const auto cursor = recovery.patches();
        PatchInfo patch;
        while (cursor->next(patch)) {
          for (const LayerInfo& info : patch.layers) {
            StoredLayer stored;
            recovery.load_stored(info, stored);
            EXPECT_TRUE(own.contains(stored.content_hash)) << told;
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace apgm
