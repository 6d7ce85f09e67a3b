#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>

#include "archive_merge.hpp"
#include "archive_support.hpp"
#include "archive_target.hpp"
#include "content_id.hpp"
#include "crash_disk.hpp"
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

void commit(CommitTarget& target, const Map& base, const Map& next) {
  ArchiveMerge merge(target, next.header(), gone_from(base, next));
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

/// One archive through commits, tags, crashes and errors, beside what it must hold.
class History {
 public:
  History(std::uint64_t seed, Figures& figures) : rng_(seed), figures_(figures) {
    maps_.push_back(changed_map(empty_map(), rng_, 6));
    disk_.emplace(new_archive(maps_.back()));
    ends_.push_back(disk_->size());
    prefix_ = disk_->current();
    ++figures_.histories;
  }

  void run() {
    const int steps = 3 + static_cast<int>(rng_() % 6);
    for (int i = 0; i < steps; ++i) {
      step();
      if (::testing::Test::HasFailure()) return;
    }
    disk_->restart();
    const Map next = changed_map(maps_.back(), rng_, 2);  // and the next commit works
    attempt([&](AppendTarget& target) { commit(target, maps_.back(), next); });
    EXPECT_TRUE(done_);
    check(&next);
  }

 private:
  void step() {
    using Fault = CrashDisk::Fault;
    constexpr Fault kFaults[] = {Fault::kNone,  Fault::kCrash,    Fault::kCrash,
                                 Fault::kError, Fault::kFullDisk, Fault::kDeadDisk};
    const Fault fault = kFaults[rng_() % std::size(kFaults)];
    disk_->arm(fault, rng_() % 24, rng_());
    const bool tags = rng_() % 5 == 0;
    const Map next = tags ? maps_.back() : changed_map(maps_.back(), rng_, 1 + static_cast<int>(rng_() % 4));
    attempt([&](AppendTarget& target) {
      if (tags) return write_tags(target, {{"t" + std::to_string(rng_() % 9), 1}});
      commit(target, maps_.back(), next);
    });
    // After an error the machine may go on, or fail as well.
    const bool crash = fault == Fault::kCrash ? disk_->met_fault() : rng_() % 3 == 0;
    if (crash) {
      disk_->crash(rng_);
      ++figures_.crashes;
    }
    disk_->restart();
    if (disk_->met_fault() && !crash) ++figures_.errors;
    if (!done_ && !tags) maybe_.push_back(next);
    check(tags ? nullptr : &next);
    if (done_ || crash) maybe_.clear();
  }

  template <typename Work>
  void attempt(Work work) {
    done_ = false;
    try {
      AppendTarget target(*disk_, "disk");
      work(target);
      done_ = true;
      ++figures_.commits;
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::kOutput) << e.message();
    }
  }

  /// What was acknowledged is there; what was under way may be, whole.
  void check(const Map* next) {
    const std::vector<std::byte>& bytes = disk_->current();
    try {
      const Reader reader(bytes, "disk");
      const std::uint64_t number = reader.file().commits;
      const bool is_next = number == maps_.size() + 1;
      EXPECT_TRUE(is_next || number == maps_.size());
      EXPECT_TRUE(is_next || !done_ || next == nullptr);
      EXPECT_EQ(reader.commits().size(), number);
      const std::uint64_t end = bytes.size() - reader.file().uncommitted_bytes;
      EXPECT_GE(end, ends_.back());
      EXPECT_TRUE(std::equal(prefix_.begin(), prefix_.end(), bytes.begin()));
      const Map last = read_commit(reader);
      if (!is_next) {
        EXPECT_TRUE(same_content(last, maps_.back()));
      } else if (done_) {
        EXPECT_TRUE(same_content(last, *next));
      } else {
        EXPECT_TRUE(std::ranges::any_of(maybe_, [&](const Map& map) { return same_content(last, map); }));
      }
      const std::size_t any = rng_() % maps_.size();
      EXPECT_TRUE(same_content(read_commit(Reader(bytes, "disk", {.commit = any + 1})), maps_[any]));
      figures_.read_back += 2;
      if (is_next && !done_) ++figures_.in_flight_kept;
      if (is_next) maps_.push_back(last);
      if (!done_ && end > ends_.back()) disk_->sync();  // as the next writer does before all else
      ends_.push_back(end);
      prefix_.assign(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(end));
    } catch (const Error& e) {
      ADD_FAILURE() << e.message();
    }
    if (::testing::Test::HasFailure()) ++figures_.lost;
  }

  std::mt19937_64 rng_;
  Figures& figures_;
  std::optional<CrashDisk> disk_;
  std::vector<Map> maps_;            // by number of the commit, from 1
  std::vector<std::uint64_t> ends_;  // of what was read back
  std::vector<std::byte> prefix_;    // that may never change again
  std::vector<Map> maybe_;           // that failed, but may be found after a crash
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
