#include "apgm/format/archive.hpp"

#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <functional>
#include <set>
#include <thread>

#include "apgm/core/budget.hpp"
#include "apgm/core/error.hpp"
#include "archive_support.hpp"

namespace apgm::test {
namespace {

namespace fs = std::filesystem;

std::vector<char> bytes_at(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

Error error_of(const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& e) {
    EXPECT_FALSE(e.message().empty());
    return e;
  }
  ADD_FAILURE() << "nothing was thrown";
  return {ErrorCode::kCancelled, "nothing was thrown"};
}

ErrorCode code_of(const std::function<void()>& work) { return error_of(work).code(); }

class ArchiveTest : public ::testing::Test {
 protected:
  void SetUp() override {
    dir_ = fs::temp_directory_path() / ("apgm_archive_" + std::to_string(::getpid()) + "_" +
                                        ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(dir_);
  }
  void TearDown() override { fs::remove_all(dir_); }
  std::string path(const std::string& name) const { return (dir_ / name).string(); }

  /// An archive of `commits` random commits; their maps in order.
  std::vector<Map> random_archive(const std::string& file, std::uint64_t seed, int commits) {
    std::mt19937_64 rng(seed);
    std::vector<Map> maps;
    Map base = empty_map();
    for (int i = 0; i < commits; ++i) {
      Map next = changed_map(base, rng, i == 0 ? 20 : static_cast<int>(rng() % 5));
      next.set_stamp_ns(100 * (i + 1));
      commit_map(file, base, next, {.message = "commit " + std::to_string(i + 1)});
      maps.push_back(next);
      base = next;
    }
    return maps;
  }

  fs::path dir_;
};

TEST_F(ArchiveTest, EveryCommitReadsBackAsItWas) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const std::string file = path("a" + std::to_string(seed) + ".apgm");
    const std::vector<Map> maps = random_archive(file, seed, 8);
    for (std::size_t i = 0; i < maps.size(); ++i) {
      const Reader reader(file, {.commit = i + 1});
      EXPECT_TRUE(same_content(read_commit(reader), maps[i]));
      // A sealed file of it is what a Writer makes of the map.
      write_map(maps[i], path("direct.apgm"), {.output = {.overwrite = true}});
      write_map(reader, path("checkout.apgm"), {.output = {.overwrite = true}});
      EXPECT_EQ(bytes_at(path("direct.apgm")), bytes_at(path("checkout.apgm")));
      EXPECT_EQ(Reader(path("direct.apgm")).content_id(), reader.content_id());
    }
    EXPECT_EQ(Reader(file).file().commits, maps.size());
    EXPECT_EQ(Reader(file).file().version_minor, 1);
  }
}

TEST_F(ArchiveTest, LogTellsEachCommit) {
  const std::string file = path("a.apgm");
  const std::vector<Map> maps = random_archive(file, 3, 4);
  EXPECT_EQ(tag_commit(file, "first", 1), 1u);
  EXPECT_EQ(tag_commit(file, "newest"), 4u);
  EXPECT_EQ(tag_commit(file, "a.b-c", 4), 4u);
  const Reader reader(file);
  const std::vector<CommitInfo> log = reader.commits();
  ASSERT_EQ(log.size(), 4u);
  std::uint64_t bytes = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(log[i].number, i + 1);
    EXPECT_EQ(log[i].message, "commit " + std::to_string(i + 1));
    EXPECT_EQ(log[i].stamp_ns, 100 * static_cast<std::int64_t>(i + 1));
    EXPECT_EQ(log[i].patches, maps[i].size());
    EXPECT_EQ(log[i].content_id, Reader(file, {.commit = i + 1}).content_id());
    bytes += log[i].added_bytes;
  }
  EXPECT_EQ(bytes, fs::file_size(file));
  EXPECT_EQ(log[0].tags, std::vector<std::string>{"first"});
  EXPECT_EQ(log[3].tags, (std::vector<std::string>{"a.b-c", "newest"}));
  EXPECT_FALSE(reader.header().metadata.contains("apgm.archive.tags"));
  EXPECT_FALSE(reader.header().metadata.contains("apgm.archive.message"));
}

TEST_F(ArchiveTest, TagsMoveAndGo) {
  const std::string file = path("a.apgm");
  const std::vector<Map> maps = random_archive(file, 4, 3);
  tag_commit(file, "good", 1);
  tag_commit(file, "good", 2);
  commit_map(file, maps.back(), maps.back(), {.message = "", .tags = {"best"}});
  std::vector<CommitInfo> log = Reader(file).commits();
  ASSERT_EQ(log.size(), 4u);
  EXPECT_TRUE(log[0].tags.empty());
  EXPECT_EQ(log[1].tags, std::vector<std::string>{"good"});
  EXPECT_EQ(log[3].tags, std::vector<std::string>{"best"});
  remove_tag(file, "good");
  log = Reader(file).commits();
  EXPECT_TRUE(log[1].tags.empty());
  EXPECT_EQ(code_of([&] { remove_tag(file, "good"); }), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code_of([&] { tag_commit(file, "x", 9); }), ErrorCode::kInvalidArgument);
  for (const char* bad : {"", "1", "a b", "2026-01-01", "a=b", "\xc3\xa4"}) {
    EXPECT_EQ(code_of([&] { tag_commit(file, bad); }), ErrorCode::kInvalidArgument) << bad;
  }
  EXPECT_EQ(code_of([&] { Reader(file, {.commit = 5}); }), ErrorCode::kInvalidArgument);
}

TEST_F(ArchiveTest, StoresOnlyWhatChanged) {
  const std::string file = path("a.apgm");
  Map map = sample_map(5, 200, 5);
  const CommitReport first = commit_map(file, Map(map.header()), map);
  EXPECT_EQ(first.layers_written, first.layers);
  const CommitReport same = commit_map(file, map, map);
  EXPECT_EQ(same.layers_written, 0u);
  EXPECT_EQ(same.content_id, first.content_id);
  EXPECT_LT(same.added_bytes, 2048u);
  Map next = map;
  const PatchIndex one = next.by_key().begin()->second.index;
  next.layer(one, 0, 3).plane(0)[0] = 0.125f;
  const CommitReport changed = commit_map(file, map, next);
  EXPECT_EQ(changed.layers_written, 1u);
  EXPECT_NE(changed.content_id, first.content_id);
  EXPECT_LT(changed.added_bytes, first.added_bytes / 5);
}

TEST_F(ArchiveTest, PagesSplitAndJoin) {
  const std::string file = path("a.apgm");
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  std::mt19937_64 rng(6);
  std::vector<Map> maps{Map(header)};
  for (const int patches : {3000, 9000, 400, 0, 5000}) {
    Map next(header);
    for (int i = 0; i < patches; ++i) {
      const PatchIndex index{static_cast<std::int32_t>(rng() % 100), static_cast<std::int32_t>(rng() % 100)};
      next.layer(index, 0, 0).plane(0)[0] = 0.5f + 0.125f * static_cast<float>(rng() % 4);
    }
    commit_map(file, maps.back(), next);
    maps.push_back(std::move(next));
    const Reader reader(file);
    EXPECT_TRUE(same_content(read_commit(reader), maps.back()));
    write_map(maps.back(), path("direct.apgm"), {.output = {.overwrite = true}});
    EXPECT_EQ(Reader(path("direct.apgm")).content_id(), reader.content_id());
  }
}

TEST_F(ArchiveTest, CompactKeepsWhatItSays) {
  for (std::uint64_t seed = 30; seed < 40; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const std::string file = path("a" + std::to_string(seed) + ".apgm");
    const std::vector<Map> maps = random_archive(file, seed, 9);
    tag_commit(file, "old", 2);
    const std::vector<CommitInfo> log = Reader(file).commits();
    const CompactReport all = compact_archive(file, {.output = path("all.apgm"), .overwrite = true});
    EXPECT_EQ(all.commits, 9u);
    EXPECT_LE(all.file_bytes, all.file_bytes_before);
    std::vector<CommitInfo> after = Reader(path("all.apgm")).commits();
    ASSERT_EQ(after.size(), log.size());
    for (std::size_t i = 0; i < log.size(); ++i) {
      after[i].added_bytes = log[i].added_bytes;
      EXPECT_EQ(after[i], log[i]);
      EXPECT_TRUE(same_content(read_commit(Reader(path("all.apgm"), {.commit = i + 1})), maps[i]));
    }
    const CompactReport few = compact_archive(file, {.keep = 3});
    EXPECT_EQ(few.commits, 4u);
    const Reader reader(file);
    const std::vector<CommitInfo> kept = reader.commits();
    ASSERT_EQ(kept.size(), 4u);
    EXPECT_EQ(kept[0].number, 2u);
    EXPECT_EQ(kept[0].tags, std::vector<std::string>{"old"});
    for (const CommitInfo& info : kept) {
      EXPECT_TRUE(same_content(read_commit(Reader(file, {.commit = info.number})), maps[info.number - 1]));
    }
    EXPECT_EQ(code_of([&] { Reader(file, {.commit = 3}); }), ErrorCode::kInvalidArgument);
    EXPECT_EQ(commit_map(file, maps.back(), maps.front()).number, 10u);
    EXPECT_TRUE(same_content(read_commit(Reader(file)), maps.front()));
  }
}

TEST_F(ArchiveTest, EqualLayersAreStoredOnceAfterCompacting) {
  const std::string file = path("a.apgm");
  const Map one = sample_map(9, 40), other = sample_map(10, 40);
  const CommitReport first = commit_map(file, Map(one.header()), one);
  commit_map(file, one, other);
  commit_map(file, other, one);
  const CompactReport report = compact_archive(file);
  EXPECT_LT(report.file_bytes, report.file_bytes_before - first.added_bytes / 2);
  EXPECT_TRUE(same_content(read_commit(Reader(file)), one));
}

TEST_F(ArchiveTest, TwoWritersCannotBothWin) {
  const std::string file = path("a.apgm");
  const std::vector<Map> maps = random_archive(file, 11, 1);
  ArchiveWriter first(file);
  EXPECT_EQ(code_of([&] { ArchiveWriter second(file); }), ErrorCode::kOutput);
  EXPECT_EQ(code_of([&] { tag_commit(file, "x"); }), ErrorCode::kOutput);
  EXPECT_EQ(code_of([&] { compact_archive(file); }), ErrorCode::kOutput);
  first.begin(maps.back().header());
  first.finish();
  EXPECT_EQ(first.report().number, 2u);
}

TEST_F(ArchiveTest, TwoNewArchivesCannotBothWin) {
  const std::string file = path("a.apgm");
  const Map map = sample_map(1);
  ArchiveWriter first(file, {.create = true}), second(file, {.create = true});
  for (ArchiveWriter* writer : {&first, &second}) writer->begin(map.header());
  first.finish();
  const Error lost = error_of([&] { second.finish(); });
  EXPECT_EQ(Reader(file).file().commits, 1u);
  // Who comes second is told the same as who finds the archive locked.
  ArchiveWriter third(file);
  const Error locked = error_of([&] { ArchiveWriter fourth(file); });
  for (const Error& error : {lost, locked}) {
    EXPECT_EQ(error.code(), ErrorCode::kOutput);
    EXPECT_EQ(error.message(), "another process writes to '" + file + "'");
    EXPECT_THAT(error.hint(), testing::HasSubstr("try again"));
    EXPECT_EQ(error.path(), file);
  }
}

TEST_F(ArchiveTest, WhatStandsForATimeIsNoTag) {
  const std::string file = path("a.apgm");
  random_archive(file, 15, 1);
  const auto before = bytes_at(file);
  for (const char* tag : {"now", "12", "007", "1e3", "-1", "@5", "2026-01-31T12:00:00Z", "", "a b"}) {
    EXPECT_EQ(code_of([&] { tag_commit(file, tag); }), ErrorCode::kInvalidArgument) << tag;
    EXPECT_EQ(code_of([&] {
                ArchiveWriter writer(file);
                writer.begin(empty_map().header(), {}, {.tags = {tag}});
              }),
              ErrorCode::kInvalidArgument)
        << tag;
  }
  EXPECT_EQ(bytes_at(file), before);
  EXPECT_EQ(tag_commit(file, "now.1"), 1u);
}

TEST_F(ArchiveTest, OnlyRegularFilesAreWrittenTo) {
  const std::string pipe = path("pipe");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  for (const std::string& file : {pipe, std::string("/dev/null")}) {
    const Error error = error_of([&] { ArchiveWriter(file, {.create = true}); });
    EXPECT_EQ(error.code(), ErrorCode::kOutput);
    EXPECT_EQ(error.message(), "'" + file + "' is not a regular file");
    EXPECT_EQ(code_of([&] { tag_commit(file, "x"); }), ErrorCode::kOutput);
  }
}

TEST_F(ArchiveTest, CompactingStaysWithinItsBudget) {
  const std::string file = path("a.apgm");
  random_archive(file, 16, 3);
  const auto before = bytes_at(file);
  const Error error = error_of([&] { compact_archive(file, {.max_memory_bytes = 1000}); });
  const auto hint = budget_hint(error);
  ASSERT_TRUE(hint) << error.message();
  EXPECT_EQ(bytes_at(file), before);
  std::uint64_t told = 0;
  CompactOptions options{.max_memory_bytes = hint->least_mebibytes << 20};
  options.progress = [&](std::uint64_t done, std::uint64_t total) {
    EXPECT_LE(done, total);
    EXPECT_GE(done, told);
    told = done;
  };
  EXPECT_EQ(compact_archive(file, options).commits, 3u);
  EXPECT_GT(told, 0u);
}

TEST_F(ArchiveTest, CompactingADamagedCommitTellsHowToGoOn) {
  const std::string file = path("a.apgm");
  const Map one = sample_map(9, 40), other = sample_map(10, 40);
  commit_map(file, Map(one.header()), one);
  commit_map(file, one, other);
  // The first layer of the first commit that later ones do not share.
  std::vector<LayerInfo> old;
  {
    const Reader first(file, {.commit = 1}), last(file);
    std::set<std::uint64_t> shared;
    PatchInfo patch;
    for (const auto cursor = last.patches(); cursor->next(patch);) {
      for (const LayerInfo& info : patch.layers) shared.insert(info.locator);
    }
    for (const auto cursor = first.patches(); cursor->next(patch);) {
      for (const LayerInfo& info : patch.layers) {
        if (!shared.contains(info.locator)) old.push_back(info);
      }
    }
  }
  ASSERT_FALSE(old.empty());
  std::fstream(file, std::ios::in | std::ios::out | std::ios::binary)
      .seekp(static_cast<std::streamoff>(old[0].locator) + 70)
      .write("damage", 6);
  const Error error = error_of([&] { compact_archive(file); });
  EXPECT_EQ(error.code(), ErrorCode::kDamaged);
  EXPECT_THAT(error.hint(), testing::HasSubstr("checkout --salvage --at 1'"));
  EXPECT_THAT(error.hint(), testing::HasSubstr("compact --keep"));
  EXPECT_EQ(compact_archive(file, {.keep = 1}).commits, 1u);
}

TEST_F(ArchiveTest, ExpectedNumberIsChecked) {
  const std::string file = path("a.apgm");
  const auto open = [&](std::uint64_t expected) {
    ArchiveWriter writer(file, {.create = true, .expected = expected});
  };
  const Error none = error_of([&] { open(1); });
  EXPECT_EQ(none.code(), ErrorCode::kIncompatible);
  EXPECT_EQ(none.message(), "there is no archive '" + file + "', its last commit was to be 1");
  open(0);
  random_archive(file, 12, 2);
  open(2);
  const Error earlier = error_of([&] { open(1); });
  EXPECT_EQ(earlier.code(), ErrorCode::kIncompatible);
  EXPECT_THAT(earlier.hint(), testing::HasSubstr("somebody committed in between"));
  EXPECT_EQ(code_of([&] { open(0); }), ErrorCode::kIncompatible);
  const Error later = error_of([&] { open(3); });
  EXPECT_EQ(later.code(), ErrorCode::kIncompatible);
  EXPECT_THAT(later.hint(), testing::HasSubstr("commits are missing at its end"));
  EXPECT_THAT(later.hint(), testing::HasSubstr("'apgm-verify " + file + "'"));
}

TEST_F(ArchiveTest, ADryRunCountsWhatTheCommitThenDoes) {
  const std::string file = path("a.apgm");
  Map base(sample_map(3).header());
  for (std::uint64_t seed = 3; seed < 6; ++seed) {
    const Map next = sample_map(seed);
    const auto before = bytes_at(file);
    CommitReport reports[2];
    for (const bool dry : {true, false}) {
      ArchiveWriter writer(file, {.create = true, .dry_run = dry});
      writer.begin(next.header(), gone_from(base, next), {.message = "m", .tags = {"t"}});
      put_changes(base, next, writer);
      writer.finish();
      reports[dry ? 0 : 1] = writer.report();
      EXPECT_EQ(bytes_at(file) == before, dry);
    }
    EXPECT_EQ(reports[0].number, seed - 2);
    EXPECT_EQ(reports[0].content_id, reports[1].content_id);
    EXPECT_EQ(reports[0].file_bytes, reports[1].file_bytes);
    EXPECT_EQ(reports[0].added_bytes, reports[1].added_bytes);
    EXPECT_EQ(reports[0].layers_written, reports[1].layers_written);
    base = next;
  }
}

TEST_F(ArchiveTest, ADryRunLeavesATornEndAndIsInNobodysWay) {
  const std::string file = path("a.apgm");
  const std::vector<Map> maps = random_archive(file, 17, 2);
  std::ofstream(file, std::ios::binary | std::ios::app) << std::string(1000, 'x');
  const auto before = bytes_at(file);
  {
    const ArchiveWriter other(file);
    ArchiveWriter writer(file, {.dry_run = true});
    EXPECT_EQ(writer.torn().bytes, 1000u);
    writer.begin(maps.back().header());
    writer.finish();
    EXPECT_EQ(writer.report().number, 3u);
  }
  EXPECT_EQ(bytes_at(file), before);
}

TEST_F(ArchiveTest, RefusesWhatIsNoArchive) {
  const Map map = sample_map(2);
  write_map(map, path("sealed.apgm"));
  const auto open = [&](const std::string& name) { ArchiveWriter writer(path(name)); };
  EXPECT_EQ(code_of([&] { open("sealed.apgm"); }), ErrorCode::kIncompatible);
  EXPECT_EQ(code_of([&] { open("missing.apgm"); }), ErrorCode::kOutput);
  EXPECT_EQ(code_of([&] { compact_archive(path("sealed.apgm")); }), ErrorCode::kIncompatible);
  std::ofstream(path("text.apgm")) << "hello";
  EXPECT_EQ(code_of([&] { open("text.apgm"); }), ErrorCode::kForeign);
  EXPECT_EQ(Reader(path("sealed.apgm")).commits().size(), 1u);
}

TEST_F(ArchiveTest, RefusesAnotherFrame) {
  const std::string file = path("a.apgm");
  const Map map = sample_map(3);
  commit_map(file, Map(map.header()), map);
  const auto before = bytes_at(file);
  MapHeader moved = map.header();
  moved.frame.datum_x_um += 1000;
  const Error error = error_of([&] { ArchiveWriter(file).begin(moved); });
  EXPECT_EQ(error.code(), ErrorCode::kIncompatible);
  EXPECT_THAT(error.message(), testing::HasSubstr("': datums differ ("));
  EXPECT_EQ(bytes_at(file), before);
}

TEST_F(ArchiveTest, LayersOfTypesThatAreNoMoreAreGone) {
  const std::string file = path("a.apgm");
  const Map map = sample_map(3);
  commit_map(file, Map(map.header()), map);
  MapHeader fewer = map.header();
  LayerType velocity = LayerType::real("velocity", {"vx", "vy"});
  LayerType semantic = map.header().types[*map.header().types.find("semantic")];
  velocity.policy = Policy::kSum;  // another background: what is not stored would become 0
  fewer.types = TypeTable({velocity, semantic});
  ArchiveWriter writer(file);
  writer.begin(fewer);
  writer.finish();
  const Reader reader(file);
  EXPECT_EQ(reader.summary().types[0].layers, map.summary().types[1].layers);
  EXPECT_EQ(reader.summary().types[1].layers, 0u);
  EXPECT_TRUE(same_content(read_commit(Reader(file, {.commit = 1})), map));
}

TEST_F(ArchiveTest, NothingIsLeftOfACommitThatIsGivenUp) {
  const std::string file = path("a.apgm");
  const Map map = sample_map(4, 30);
  commit_map(file, Map(map.header()), map);
  const auto before = bytes_at(file);
  {
    ArchiveWriter writer(file);
    writer.begin(map.header());
    put_changes(Map(map.header()), map, writer);
  }
  EXPECT_EQ(bytes_at(file), before);
  {
    ArchiveWriter writer(path("new.apgm"), {.create = true});
    writer.begin(map.header());
    put_changes(Map(map.header()), map, writer);
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(dir_), fs::directory_iterator()), 1);
}

TEST_F(ArchiveTest, ATornEndIsToldAndCutOffByTheNextCommit) {
  const std::string file = path("a.apgm");
  const std::vector<Map> maps = random_archive(file, 13, 2);
  const auto whole = bytes_at(file);
  std::ofstream(file, std::ios::binary | std::ios::app) << std::string(200'001, 'x');
  EXPECT_EQ(Reader(file).file().uncommitted_bytes, 200'001u);
  EXPECT_TRUE(same_content(read_commit(Reader(file)), maps.back()));
  commit_map(file, maps.back(), maps.back());
  EXPECT_EQ(Reader(file).file().uncommitted_bytes, 0u);
  const auto after = bytes_at(file);
  EXPECT_TRUE(std::equal(whole.begin(), whole.end(), after.begin()));
  EXPECT_LT(after.size(), whole.size() + 4096);
}

TEST_F(ArchiveTest, ReadersKeepTheirViewWhileOthersAppendAndCompact) {
  const std::string file = path("a.apgm");
  std::vector<Map> maps = random_archive(file, 14, 3);
  std::atomic<bool> stop = false;
  std::atomic<int> reads = 0;
  const auto read = [&] {
    while (!stop) {
      try {
        const Reader reader(file);
        const std::string id = reader.content_id();
        const Map map = read_commit(reader);
        std::vector<std::byte> bytes;
        Writer writer(bytes, map.header());
        stream(map, writer);
        if (writer.report().content_id != id) ADD_FAILURE() << "another map than its content id";
        ++reads;
      } catch (const Error& e) {
        ADD_FAILURE() << e.message();
        return;
      }
    }
  };
  const Reader early(file);
  std::thread a(read), b(read);
  std::mt19937_64 rng(15);
  for (int i = 0; i < 60 || reads < 20; ++i) {
    Map next = changed_map(maps.back(), rng, 3);
    commit_map(file, maps.back(), next);
    if (i % 10 == 9) compact_archive(file, {.keep = 2});
    if (i % 7 == 3) {
      ArchiveWriter given_up(file);
      given_up.begin(next.header());
    }
    maps.push_back(std::move(next));
  }
  stop = true;
  a.join();
  b.join();
  EXPECT_TRUE(same_content(read_commit(early), maps[2]));
}

TEST_F(ArchiveTest, SaysWhatPackingTakesAsAWriterDoes) {
  constexpr std::uint64_t kLayerBytes = std::uint64_t{8} << 20;
  for (const int level : {1, 19}) {
    const ArchiveWriter archive(path(std::to_string(level)), {.create = true, .level = level});
    std::vector<std::byte> bytes;
    WriterOptions options;
    options.level = level;
    const Writer file(bytes, MapHeader(), options);
    EXPECT_EQ(archive.working_bytes(kLayerBytes), file.working_bytes(kLayerBytes));
  }
}

}  // namespace
}  // namespace apgm::test
