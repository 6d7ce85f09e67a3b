#include "apgm/format/recover.hpp"

#include <gmock/gmock.h>

#include <chrono>

#include "apgm/core/error.hpp"
#include "apgm/format/message.hpp"
#include "apgm/format/verify.hpp"
#include "file_parts.hpp"
#include "map_header.hpp"
#include "sample_map.hpp"
#include "temp_dir.hpp"

namespace apgm {
namespace {

using format::Kind;
using testing::HasSubstr;
using namespace test;

class RecoverTest : public testing::Test {
 protected:
  void SetUp() override {
    write_map(sample_map(21, 6, 4), dir_ / "good.apgm");
    good_ = read_file(dir_ / "good.apgm");
    id_ = Reader(dir_ / "good.apgm").content_id();
    layers_ = Recovery(dir_ / "good.apgm").report().layers;
    was_.emplace(read_map(dir_ / "good.apgm"));
  }
  /// Recovers a file with these bytes; what is written is checked, and no layer in it is other than it was,
  /// unless that is told of.
  RecoverReport recover(const std::string& bytes, const RecoverOptions& options = {}) {
    const Recovery recovery(std::as_bytes(std::span(bytes)), options);
    out_.clear();
    foreign_ = 0;
    Writer writer(out_, recovery.header());
    stream(recovery, writer);
    VerifyOptions deep;
    deep.deep = true;
    deep.threads = 1;
    EXPECT_TRUE(verify(out_, deep).valid());
    const Map is = map_from_bytes(out_);
    std::uint64_t layers = 0;
    for (const auto& [key, patch] : is.by_key()) {
      for (const auto& [type, layer] : patch.layers) {
        const auto old = was_->header().types.find(is.header().types[type].name);
        const Layer* before = old ? was_->find(patch.index, *old) : nullptr;
        foreign_ += before == nullptr || !same_cells(*before, layer) || before->stamp_ns != layer.stamp_ns;
        ++layers;
      }
    }
    EXPECT_EQ(layers, recovery.report().layers);
    told_.clear();
    for (const Loss& loss : recovery.report().losses) told_ += loss.text + "\n";
    EXPECT_TRUE(foreign_ == 0 || told_.find("nothing vouches for") != std::string::npos) << told_;
    out_id_ = writer.report().content_id;
    return recovery.report();
  }
  void expect_all(const RecoverReport& report) {
    EXPECT_EQ(report.loss_count, 0u) << (report.losses.empty() ? "" : report.losses[0].text);
    EXPECT_EQ(report.layers, layers_);
    EXPECT_EQ(out_id_, id_);
  }
  std::vector<BlockAt> layer_blocks() const {
    std::vector<BlockAt> blocks = blocks_of(good_);
    std::erase_if(blocks, [](const BlockAt& b) { return b.header.kind != Kind::kLayer; });
    return blocks;
  }

  TempDir dir_;
  std::string good_, id_, out_id_, told_;  // told_: all losses
  std::uint64_t foreign_ = 0;              // layers that are other than they were
  std::vector<std::byte> out_;
  std::optional<Map> was_;
  std::uint64_t layers_ = 0;
};

TEST_F(RecoverTest, GoodFileComesBackWithAStepInItsHistory) {
  expect_all(recover(good_));
  const Reader out(out_);
  EXPECT_EQ(out.header().metadata, Reader(dir_ / "good.apgm").header().metadata);
  const Provenance& step = out.header().history.back();
  EXPECT_EQ(step.operation, "recover");
  EXPECT_THAT(step.inputs, testing::ElementsAre(id_));
  EXPECT_EQ(step.parameters, "{\"losses\":0}");
}

TEST_F(RecoverTest, AnySingleFlippedBitIsTurnedBack) {
  for (std::size_t byte = 0; byte < good_.size(); byte += 3) {
    SCOPED_TRACE(byte);
    expect_all(recover(flipped(good_, byte, static_cast<int>(byte % 8))));
  }
}

TEST_F(RecoverTest, AZeroedLayerIsTheOnlyOneLost) {
  for (const BlockAt& block : layer_blocks()) {
    const RecoverReport report = recover(zeroed(good_, block.offset, block.bytes));
    EXPECT_EQ(report.layers, layers_ - 1);
    ASSERT_EQ(report.loss_count, 1u);
    EXPECT_TRUE(report.losses[0].patch.has_value());
    EXPECT_NE(report.losses[0].layer, "");
    EXPECT_EQ(report.losses[0].offset, block.offset);
  }
}

TEST_F(RecoverTest, LostPiecesOfTheIndexCostNothing) {
  for (const Kind kind : {Kind::kIndexPage, Kind::kIndexRoot, Kind::kFooter}) {
    const BlockAt block = first_of(good_, kind);
    expect_all(recover(zeroed(good_, block.offset, block.bytes)));
  }
  expect_all(recover(zeroed(good_, 0, sizeof(format::Preamble))));
}

TEST_F(RecoverTest, WithoutIndexAndFooterAllLayersAreSavedButNotVouchedFor) {
  const BlockAt page = first_of(good_, Kind::kIndexPage);
  const RecoverReport report = recover(good_.substr(0, page.offset));
  EXPECT_EQ(report.layers, layers_);
  EXPECT_EQ(out_id_, id_);
  EXPECT_FALSE(report.index);
  ASSERT_EQ(report.loss_count, 1u);
  EXPECT_THAT(report.losses[0].text, HasSubstr("the index of commit 1"));
}

TEST_F(RecoverTest, EveryTruncationKeepsTheLayersBeforeIt) {
  const auto blocks = layer_blocks();
  for (std::size_t size = blocks[0].offset; size < good_.size(); size += 11) {
    SCOPED_TRACE(size);
    const RecoverReport report = recover(good_.substr(0, size));
    const auto whole = std::ranges::count_if(blocks, [&](const BlockAt& b) {
      return b.offset + sizeof(b.header) + b.header.payload_bytes <= size;
    });
    EXPECT_GE(report.layers + 1, static_cast<std::uint64_t>(whole));
  }
}

TEST_F(RecoverTest, BytesPutInOrCutOutMoveWhatFollowsAndLoseNothingElse) {
  const auto blocks = layer_blocks();
  std::string more = good_, less = good_;
  more.insert(blocks[2].offset, "some bytes");
  expect_all(recover(more));
  less.erase(blocks[2].offset + 80, 3);
  const RecoverReport report = recover(less);
  EXPECT_EQ(report.layers, layers_ - 1);
  ASSERT_EQ(report.loss_count, 1u);
}

TEST_F(RecoverTest, MapHeaderWhoseOwnHeaderIsGoneIsFoundByTheFootersHash) {
  const BlockAt block = first_of(good_, Kind::kMapHeader);
  std::string bad = zeroed(good_, block.offset, sizeof(block.header));
  expect_all(recover(bad));
  expect_all(recover(flipped(bad, block.offset + 100, 3)));
}

TEST_F(RecoverTest, AnotherMapStandsInForALostHeader) {
  const BlockAt block = first_of(good_, Kind::kMapHeader);
  const std::string bad = zeroed(good_, block.offset, block.bytes);
  try {
    recover(bad);
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kDamaged);
    EXPECT_NE(dynamic_cast<const HeaderLost*>(&e), nullptr);
    EXPECT_THAT(e.message(), HasSubstr("no map header is left"));
  }
  const Reader other(dir_ / "good.apgm");
  RecoverOptions options;
  options.header = &other.header();
  const RecoverReport report = recover(bad, options);
  EXPECT_EQ(report.layers, layers_);
  ASSERT_EQ(report.loss_count, 1u);
  EXPECT_THAT(report.losses[0].text, HasSubstr("the map header"));
  EXPECT_TRUE(Reader(out_).header().metadata.empty());
}

TEST_F(RecoverTest, AHeaderOfOtherTypesInventsNothing) {
  const BlockAt block = first_of(good_, Kind::kMapHeader);
  MapHeader other;
  other.types = TypeTable({LayerType::semantic("semantic", {"Road", "Marking", "Blocked"})});
  RecoverOptions options;
  options.header = &other;
  write_file(dir_ / "bad.apgm", zeroed(good_, block.offset, block.bytes));
  const Recovery recovery(dir_ / "bad.apgm", options);
  EXPECT_EQ(recovery.report().layers, 0u);
  EXPECT_GT(recovery.report().loss_count, 1u);
}

TEST_F(RecoverTest, NothingWholeIsAnError) {
  write_file(dir_ / "a", std::string(5000, 'x'));
  try {
    const Recovery recovery(dir_ / "a");
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kForeign);
  }
  write_file(dir_ / "b", good_.substr(0, 100));
  EXPECT_THROW(Recovery(dir_ / "b"), Error);
}

TEST_F(RecoverTest, ListIsBoundedAndTheCountIsNot) {
  std::string bad = good_;
  for (const BlockAt& block : layer_blocks()) bad = zeroed(bad, block.offset, block.bytes);
  RecoverOptions options;
  options.max_losses = 2;
  const RecoverReport report = recover(bad, options);
  EXPECT_EQ(report.layers, 0u);
  EXPECT_EQ(report.loss_count, layers_);
  EXPECT_EQ(report.losses.size(), 2u);
}

TEST_F(RecoverTest, CancelEnds) {
  const std::atomic<bool> cancel{true};
  RecoverOptions options;
  options.cancel = &cancel;
  try {
    recover(good_, options);
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kCancelled);
  }
}

/// Roots that cannot be used ask for one large header: it is read once.
TEST_F(RecoverTest, ManyBadRootsCostLinearTime) {
  std::string bad = good_.substr(0, first_of(good_, Kind::kIndexRoot).offset);
  MapHeader header = Reader(dir_ / "good.apgm").header();
  header.metadata["large"] = std::string(4'000'000, 'x');
  std::vector<std::byte> block;
  format::append_map_header(block, header);
  for (std::uint64_t i = 0; i < 20'000; ++i) {
    format::append_block(block, Kind::kIndexRoot, 0, {}, format::bytes_of(i));
  }
  bad.append(reinterpret_cast<const char*>(block.data()), block.size());
  const auto start = std::chrono::steady_clock::now();
  EXPECT_EQ(Recovery(std::as_bytes(std::span(bad))).report().layers, layers_);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(10));  // else 20000 times 4 MB
}

TEST_F(RecoverTest, RandomDamageNeverChangesALayer) {
  std::mt19937_64 rng(77);
  for (int round = 0; round < 300; ++round) {
    SCOPED_TRACE("round " + std::to_string(round));
    std::string bad = good_;
    for (std::uint64_t n = 1 + rng() % 4; n > 0; --n) {
      const std::size_t at = 600 + rng() % (bad.size() - 800), length = 1 + rng() % 300;
      switch (rng() % 4) {
        case 0:
          bad = zeroed(bad, at, std::min(length, bad.size() - at));
          break;
        case 1:
          bad.erase(at, length);
          break;
        case 2:
          bad.insert(at, bad.substr(rng() % bad.size(), length));
          break;
        default:
          bad = flipped(bad, at);
      }
    }
    try {
      recover(bad);
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::kDamaged) << e.message();
    }
  }
}

/// Blocks of another map that got into the file are as whole as its own.
class RecoverFromStraysTest : public RecoverTest {
 protected:
  void SetUp() override {
    RecoverTest::SetUp();
    Map other = sample_map(22, 9, 4);
    write_map(other, dir_ / "other.apgm");
    other_ = read_file(dir_ / "other.apgm");
    kept_end_ = first_of(good_, Kind::kIndexPage).offset;
  }
  /// `file` with a page of `size` bytes of the other map in it.
  std::string with_page(std::string file, std::size_t to, std::size_t from, std::size_t size) const {
    const std::string page = other_.substr(from, size);
    return file.replace(to, page.size(), page);
  }
  std::string other_;
  std::size_t kept_end_ = 0;  // of the layers
};

TEST_F(RecoverFromStraysTest, APageOfAnotherMapBringsNoLayer) {
  int files = 0, with_foreign = 0;
  for (const std::size_t size : {512, 4096}) {
    for (std::size_t to = size; to < good_.size(); to += size) {
      for (std::size_t from = 0; from < other_.size(); from += size) {
        SCOPED_TRACE("page " + std::to_string(from) + " at " + std::to_string(to));
        try {
          const RecoverReport report = recover(with_page(good_, to, from, size));
          EXPECT_TRUE(report.loss_count > 0 || out_id_ == id_);
          ++files;
          with_foreign += foreign_ > 0;
        } catch (const HeaderLost&) {
          EXPECT_LT(to, first_of(good_, Kind::kLayer).offset);
        }
      }
    }
  }
  // Few: layers that stand in order by chance while the index is lost. That is told.
  EXPECT_LT(10 * with_foreign, files);
}

TEST_F(RecoverFromStraysTest, NorDoesItWhereTheIndexIsLost) {
  const std::string cut = good_.substr(0, kept_end_);
  constexpr std::size_t kPage = 4096;
  for (std::size_t to = kPage; to < cut.size(); to += kPage) {
    for (std::size_t from = 0; from < other_.size(); from += kPage) {
      SCOPED_TRACE("page " + std::to_string(from) + " at " + std::to_string(to));
      recover(with_page(cut, to, from, kPage));
      EXPECT_THAT(told_, HasSubstr("the index of commit 1"));
      EXPECT_EQ(foreign_, 0u);
    }
  }
}

TEST_F(RecoverFromStraysTest, TheOwnHeaderLeads) {
  const RecoverReport report = recover(good_.substr(0, kept_end_) + other_.substr(0, other_.size() / 2));
  EXPECT_EQ(foreign_, 0u);
  EXPECT_THAT(told_, HasSubstr("nothing says that they are of this map"));
  EXPECT_EQ(report.layers, layers_);
  EXPECT_EQ(Reader(out_).header().metadata.at("site"), was_->header().metadata.at("site"));
}

TEST_F(RecoverFromStraysTest, WhatLiesBehindTheFooterIsLeftOutAndTold) {
  const BlockAt page = first_of(good_, Kind::kIndexPage);
  std::string behind;
  for (const BlockAt& block : blocks_of(other_)) {
    if (block.header.kind == Kind::kLayer) behind += other_.substr(block.offset, block.bytes);
  }
  const RecoverReport report = recover(zeroed(good_, page.offset, page.bytes) + behind);
  EXPECT_EQ(report.layers, layers_);
  EXPECT_EQ(out_id_, id_);
  EXPECT_THAT(told_, HasSubstr("whole layers are left out"));
}

TEST_F(RecoverFromStraysTest, OfTwoMapsInOneFileTheFirstIsSavedAndTheOtherTold) {
  const RecoverReport report = recover(good_ + other_);
  EXPECT_EQ(report.layers, layers_);
  EXPECT_EQ(out_id_, id_);
  EXPECT_THAT(told_, HasSubstr("whole layers are left out"));
}

TEST_F(RecoverFromStraysTest, WhatTheIndexContradictsDoesNotStandIn) {
  // The same patches and types with other cells.
  Map other(was_->header());
  for (const auto& [key, patch] : was_->by_key()) {
    for (const auto& [type, layer] : patch.layers) {
      Layer& changed = other.layer(patch.index, type, layer.step());
      changed = layer;
      if (was_->header().types[type].is_occupancy()) std::ranges::fill(changed.plane(0), 0.25f);
      if (was_->header().types[type].is_occupancy()) std::ranges::fill(changed.plane(1), 0.5f);
    }
  }
  write_map(other, dir_ / "changed.apgm");
  const std::string changed = read_file(dir_ / "changed.apgm");
  const BlockAt lost = layer_blocks()[0], stray = first_of(changed, Kind::kLayer);
  ASSERT_EQ(lost.header.key, stray.header.key);
  std::string bad = zeroed(good_, lost.offset, lost.bytes);
  bad.insert(lost.offset + lost.bytes, changed.substr(stray.offset, stray.bytes));
  const RecoverReport report = recover(bad);
  EXPECT_EQ(report.layers, layers_ - 1);
  EXPECT_THAT(told_, HasSubstr("1 whole layer is left out"));
}

TEST_F(RecoverFromStraysTest, AHeaderOfAnotherFrameDoesNotStandIn) {
  const BlockAt block = first_of(good_, Kind::kMapHeader);
  MapHeader other = was_->header();
  other.frame.frame_id = "odom";
  RecoverOptions options;
  options.header = &other;
  try {
    recover(zeroed(good_, block.offset, block.bytes), options);
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kIncompatible);
    EXPECT_THAT(e.message(), HasSubstr("the header that was given"));
  }
}

}  // namespace
}  // namespace apgm
