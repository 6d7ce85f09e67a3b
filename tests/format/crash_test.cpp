#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <functional>

#include "archive_merge.hpp"
#include "archive_support.hpp"
#include "archive_target.hpp"
#include "commits.hpp"
#include "content_id.hpp"
#include "crash_disk.hpp"
#include "late_cut_disk.hpp"
#include "layer_block.hpp"

namespace apgm::test {
namespace {

using namespace format;

struct Figures {
  std::uint64_t histories = 0, commits = 0, crashes = 0, errors = 0, read_back = 0, in_flight_kept = 0,
                lost = 0;
};

/// ArchiveMerge as a sink for `put_changes`.
struct MergeSink {
  ArchiveMerge& merge;
  const TypeTable& types;
  void pack(Parcel& parcel) const { pack_layer(parcel, types[parcel.type], 1, Lossy::kNone); }
  void put(PatchIndex /*index*/, std::span<Parcel> parcels) { merge.put(parcels); }
};

/// Tags stay, as ArchiveWriter keeps them.
void commit(CommitTarget& target, const Map& base, const Map& next) {
  MapHeader header = next.header();
  const Tags tags = target.base() == nullptr ? Tags() : tags_of(target.base()->header);
  if (!tags.empty()) header.metadata[kTagsKey] = to_text(tags);
  ArchiveMerge merge(target, header, gone_from(base, next));
  MergeSink sink{merge, next.header().types};
  put_changes(base, next, sink);
  merge.finish();
}

std::vector<std::byte> new_archive(const Map& map) {
  std::vector<std::byte> bytes;
  CreateTarget target{OutputFile(bytes)};
  commit(target, empty_map(), map);
  return bytes;
}

/// What an archive says.
struct State {
  std::uint64_t number = 0;
  Tags tags;
  Map map = empty_map();
  std::uint64_t end = 0;  // of its last footer

  bool same(const State& other) const {
    return number == other.number && tags == other.tags && same_content(map, other.map);
  }
};

/// One archive through commits, tags, crashes and errors, beside what it must hold.
class History {
 public:
  History(std::uint64_t seed, Figures& figures) : rng_(seed), figures_(figures) {
    const Map first = changed_map(empty_map(), rng_, 6);
    disk_.emplace(new_archive(first));
    maps_.push_back(first);
    visible_ = {1, {}, first, disk_->size()};
    keep(visible_);
    ++figures_.histories;
  }

  void run() {
    const int steps = 3 + static_cast<int>(rng_() % 6);
    for (int i = 0; i < steps; ++i) {
      step();
      if (::testing::Test::HasFailure()) return;
    }
    disk_->restart();  // and the next commit works
    attempt({visible_.number + 1, visible_.tags, changed_map(visible_.map, rng_, 2)});
    EXPECT_TRUE(done_);
    check(false);
    disk_->crash(rng_);
    check(true);
  }

 private:
  void step() {
    using Fault = CrashDisk::Fault;
    constexpr Fault kFaults[] = {Fault::kNone,     Fault::kCrash,    Fault::kCrash,   Fault::kError,
                                 Fault::kFullDisk, Fault::kDeadSync, Fault::kDeadDisk};
    const Fault fault = kFaults[rng_() % std::size(kFaults)];
    disk_->arm(fault, rng_() % 24, rng_());
    State next = visible_;
    if (rng_() % 5 == 0) {
      next.tags["t" + std::to_string(rng_() % 9)] = 1 + rng_() % next.number;
    } else {
      ++next.number;
      next.map = changed_map(next.map, rng_, 1 + static_cast<int>(rng_() % 4));
    }
    attempt(std::move(next));
    // After an error the machine may go on, or fail as well.
    const bool crash = fault == Fault::kCrash ? disk_->met_fault() : rng_() % 3 == 0;
    if (crash) {
      disk_->crash(rng_);
      ++figures_.crashes;
    }
    if (disk_->met_fault() && !crash) ++figures_.errors;
    disk_->restart();
    check(crash);
  }

  void attempt(State next) {
    done_ = false;
    attempted_ = std::move(next);
    const State before = visible_;
    const std::uint64_t syncs = disk_->syncs();
    try {
      AppendTarget target(*disk_, "disk");
      if (attempted_.number == before.number) {
        write_tags(target, attempted_.tags);
      } else {
        commit(target, before.map, attempted_.map);
      }
      done_ = true;
      ++figures_.commits;
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::kOutput) << e.message();
    }
    // Nothing else makes a commit durable that was found but not acknowledged.
    if (disk_->syncs() > syncs) keep(before);
    maybe_.push_back(attempted_);
  }

  /// From now on a crash may not take this away.
  void keep(const State& state) {
    const std::vector<std::byte>& bytes = disk_->current();
    kept_ = state;
    prefix_.assign(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(state.end));
  }

  bool may_be(const State& found, bool crash) const {
    if (done_) return found.same(attempted_);
    if (found.same(visible_) || found.same(attempted_)) return true;
    return crash && (found.same(kept_) ||
                     std::ranges::any_of(maybe_, [&](const State& state) { return found.same(state); }));
  }

  State read_back() const {
    const std::vector<std::byte>& bytes = disk_->current();
    const Reader reader(bytes, "disk");
    State found{
        reader.file().commits, {}, read_commit(reader), bytes.size() - reader.file().uncommitted_bytes};
    const std::vector<CommitInfo> log = reader.commits();
    EXPECT_EQ(log.size(), found.number);
    for (const CommitInfo& info : log) {
      for (const std::string& tag : info.tags) found.tags[tag] = info.number;
    }
    return found;
  }

  /// What was acknowledged is there, with its tags; what was under way may be, whole.
  void check(bool crash) {
    try {
      State found = read_back();
      EXPECT_TRUE(may_be(found, crash)) << "commit " << found.number;
      EXPECT_GE(found.end, kept_.end);
      EXPECT_TRUE(std::equal(prefix_.begin(), prefix_.end(), disk_->current().begin()));
      if (found.same(attempted_) && !done_) ++figures_.in_flight_kept;
      maps_.resize(found.number, found.map);
      maps_.back() = found.map;
      const std::size_t any = rng_() % maps_.size();
      EXPECT_TRUE(
          same_content(read_commit(Reader(disk_->current(), "disk", {.commit = any + 1})), maps_[any]));
      figures_.read_back += 2;
      visible_ = std::move(found);
      if (done_ || crash) {
        keep(visible_);
        maybe_.clear();
      }
    } catch (const Error& e) {
      ADD_FAILURE() << e.message();
    }
    if (::testing::Test::HasFailure()) ++figures_.lost;
  }

  std::mt19937_64 rng_;
  Figures& figures_;
  std::optional<CrashDisk> disk_;
  std::vector<Map> maps_;  // by number of the commit, from 1
  State visible_, attempted_;
  State kept_;                     // what no crash may take away, and
  std::vector<std::byte> prefix_;  // its bytes, that may never change again
  std::vector<State> maybe_;       // what failed, but may be found after a crash
  bool done_ = false;
};

std::uint64_t number_from(const char* variable, std::uint64_t otherwise) {
  const char* text = std::getenv(variable);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

TEST(CrashTest, NoHistoryLosesACommit) {
  const std::uint64_t histories = number_from("APGM_CRASH_HISTORIES", 1000);
  const std::uint64_t first = number_from("APGM_CRASH_SEED", 1);
  Figures figures;
  for (std::uint64_t seed = first; seed < first + histories; ++seed) {
    SCOPED_TRACE("APGM_CRASH_SEED=" + std::to_string(seed));
    History(seed, figures).run();
    if (HasFailure()) break;
  }
  std::printf(
      "{\"histories\": %llu, \"commits\": %llu, \"crashes\": %llu, \"errors\": %llu, \"read_back\": %llu, "
      "\"in_flight_kept\": %llu, \"lost\": %llu}\n",
      static_cast<unsigned long long>(figures.histories), static_cast<unsigned long long>(figures.commits),
      static_cast<unsigned long long>(figures.crashes), static_cast<unsigned long long>(figures.errors),
      static_cast<unsigned long long>(figures.read_back),
      static_cast<unsigned long long>(figures.in_flight_kept), static_cast<unsigned long long>(figures.lost));
  EXPECT_EQ(figures.lost, 0u);
}

using Append = std::function<void(AppendTarget&)>;

bool succeeds(LateCutDisk& disk, const Append& append) {
  try {
    AppendTarget target(disk, "disk");
    append(target);
    return true;
  } catch (const Error&) {
    return false;
  }
}

/// What is found after the power failed.
enum class Found : std::uint8_t { kFirst, kLost, kNext };

/// A commit is all on the disk, but its last sync fails. It is cut off, and that sync fails as well: from now
/// on only the disk knows of it. Then `append` goes on for `calls` calls, and the power fails before the cut
/// is surely on the disk: what is new must not lie there beside the footer of what was cut off.
Found after_a_cut_that_was_not_synced(const Map& first, const Map& lost, std::uint64_t calls,
                                      const Append& append) {
  const std::vector<std::byte> archive = new_archive(first);
  const Append lose = [&](AppendTarget& target) { commit(target, first, lost); };
  LateCutDisk trial(archive);
  EXPECT_TRUE(succeeds(trial, lose));
  LateCutDisk disk(archive);
  disk.fail_syncs_after(trial.syncs() - 1);
  EXPECT_FALSE(succeeds(disk, lose));
  EXPECT_EQ(disk.current(), archive) << "the next writer sees nothing of it";
  disk.fail_syncs_after(LateCutDisk::kNever);
  disk.fail_calls_after(calls);
  const bool done = succeeds(disk, append);
  disk.crash();
  const Reader reader(disk.current(), "disk");
  if (same_content(read_commit(reader), lost)) return Found::kLost;
  return done ? Found::kNext : Found::kFirst;
}

TEST(CrashTest, WhatIsCutOffIsGoneBeforeAnythingNewIsWritten) {
  std::mt19937_64 rng(9);
  const Map first = changed_map(empty_map(), rng, 6);
  const Map lost = changed_map(first, rng, 40), next = changed_map(first, rng, 2);
  for (const Append& append :
       {Append([&](AppendTarget& target) { commit(target, first, next); }), Append([](AppendTarget& target) {
          write_tags(target, {{"tag", 1}});
        })}) {
    std::vector<Found> found;
    while (found.empty() || found.back() != Found::kNext) {
      SCOPED_TRACE("calls " + std::to_string(found.size()));
      ASSERT_NO_THROW(found.push_back(after_a_cut_that_was_not_synced(first, lost, found.size(), append)));
      ASSERT_FALSE(HasFailure());
    }
    // It may come back as long as nothing was written in its place.
    EXPECT_EQ(found.front(), Found::kLost);
    EXPECT_TRUE(std::ranges::is_partitioned(found, [](Found f) { return f == Found::kLost; }));
    EXPECT_GT(std::ranges::count(found, Found::kFirst), 2);
  }
}

/// Every cut of the last commit leaves the one before; every byte of it that goes bad is noticed or leaves
/// it.
TEST(CrashTest, EveryLengthOfATornCommitReadsTheOneBefore) {
  std::mt19937_64 rng(7);
  const Map first = changed_map(empty_map(), rng, 8);
  const Map second = changed_map(first, rng, 3);
  CrashDisk disk(new_archive(first));
  const std::uint64_t end = disk.size();
  {
    AppendTarget target(disk, "disk");
    commit(target, first, second);
  }
  for (std::uint64_t size = end; size < disk.size(); ++size) {
    const auto bytes = std::span(disk.current()).first(size);
    const Reader reader(bytes);
    ASSERT_EQ(reader.file().commits, 1u);
    ASSERT_EQ(reader.file().uncommitted_bytes, size - end);
  }
  EXPECT_EQ(Reader(disk.current()).file().commits, 2u);
}

TEST(CrashTest, ADamagedLastFooterIsNotATornOne) {
  std::mt19937_64 rng(8);
  const Map map = changed_map(empty_map(), rng, 8);
  const std::vector<std::byte> good = new_archive(map);
  for (std::size_t i = good.size() - kFooterBlockBytes; i < good.size(); ++i) {
    std::vector<std::byte> bytes = good;
    bytes[i] ^= std::byte{4};
    try {
      const Reader reader(bytes);
      ADD_FAILURE() << "byte " << i << " was accepted";
    } catch (const Error& e) {
      EXPECT_TRUE(e.code() == ErrorCode::kDamaged || e.code() == ErrorCode::kUnsupported) << e.message();
    }
  }
}

}  // namespace
}  // namespace apgm::test
