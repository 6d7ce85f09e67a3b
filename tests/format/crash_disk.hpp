#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <random>
#include <vector>

#include "apgm/core/error.hpp"
#include "append_file.hpp"

namespace apgm::test {

/// A file on a disk that keeps its promises and no more: what was synced stays; of what came after any part
/// may be there after a crash. After a sync that failed the next may succeed without what the first one lost,
/// though that is still read, as on Linux. The process that uses it may also meet errors, or be gone at any
/// call.
class CrashDisk final : public format::AppendFile {
 public:
  enum class Fault {
    kNone,
    kCrash,     ///< from a call on nothing happens any more
    kError,     ///< one call fails, and may have done a part
    kFullDisk,  ///< from a call on nothing more can be written; cutting works
    kDeadSync,  ///< from a call on no sync succeeds; writing and cutting work
    kDeadDisk,  ///< from a call on every call that changes something fails
  };

  explicit CrashDisk(std::vector<std::byte> bytes) : durable_(bytes), current_(std::move(bytes)) {}

  /// A fault at the `call`-th call from now on.
  void arm(Fault fault, std::uint64_t call, std::uint64_t seed) {
    fault_ = fault;
    countdown_ = call;
    rng_.seed(seed);
    met_ = false;
  }
  bool met_fault() const { return met_; }
  std::uint64_t calls() const { return calls_; }
  /// That succeeded.
  std::uint64_t syncs() const { return syncs_; }
  const std::vector<std::byte>& current() const { return current_; }

  void read(std::uint64_t offset, std::span<std::byte> out) const override {
    if (offset + out.size() > current_.size()) throw Error(ErrorCode::kUnreadable, "past the end");
    std::memcpy(out.data(), current_.data() + offset, out.size());
  }
  std::uint64_t size() const override { return current_.size(); }

  void write(format::Bytes bytes) override {
    const bool fails = meets_fault(Call::kWrite);
    std::size_t done = bytes.size();
    if (fails) done = fault_ == Fault::kCrash ? rng_() % (done + 1) : rng_() % done;
    pending_.push_back(
        {current_.size(), {bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(done)}, false});
    current_.insert(current_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(done));
    if (fails) fail();
  }

  void rewrite(std::uint64_t offset, format::Bytes bytes) override {
    if (meets_fault(Call::kWrite)) fail();
    pending_.push_back({offset, {bytes.begin(), bytes.end()}, false});
  }

  void sync() override {
    if (meets_fault(Call::kSync)) {
      if (rng_() % 2 == 0) keep_some(false);
      if (rng_() % 2 == 0) std::erase_if(pending_, [](const Change& change) { return !change.cut; });
      fail();
    }
    for (const Change& change : pending_) {
      if (change.cut) {
        durable_.resize(std::min<std::size_t>(durable_.size(), change.offset));
      } else {
        put(change.offset, change.bytes);
      }
    }
    durable_.resize(current_.size());
    pending_.clear();
    partly_kept_ = false;
    ++syncs_;
  }

  void cut(std::uint64_t size) override {
    if (meets_fault(Call::kCut)) fail();
    pending_.push_back({size, {}, true});
    current_.resize(size);
  }

  /// The power fails: the disk as the next process finds it.
  void crash(std::mt19937_64& rng) {
    rng_.seed(rng());
    keep_some(!partly_kept_);
    current_ = durable_;
    pending_.clear();
    partly_kept_ = false;
    fault_ = Fault::kNone;
  }
  /// The process ends, the machine goes on.
  void restart() { fault_ = Fault::kNone; }

 private:
  struct Change {
    std::uint64_t offset;
    std::vector<std::byte> bytes;
    bool cut;
  };

  enum class Call { kWrite, kSync, kCut };

  bool meets_fault(Call call) {
    ++calls_;
    if (fault_ == Fault::kNone) return false;
    if (countdown_ > 0) {
      --countdown_;
      return false;
    }
    const bool first = !met_;
    if (fault_ == Fault::kError) {
      met_ = true;
      return first;
    }
    if (fault_ == Fault::kFullDisk && call == Call::kCut) return false;
    if (fault_ == Fault::kDeadSync && call != Call::kSync) return false;
    met_ = true;
    return true;
  }

  [[noreturn]] void fail() { throw Error(ErrorCode::kOutput, "a fault of the disk"); }

  void put(std::uint64_t offset, format::Bytes bytes) {
    if (durable_.size() < offset + bytes.size()) durable_.resize(offset + bytes.size());
    std::ranges::copy(bytes, durable_.begin() + static_cast<std::ptrdiff_t>(offset));
  }

  /// Any part of what was not synced reaches the disk: sectors whole or not at all, or all up to any byte.
  void keep_some(bool up_to_a_byte) {
    partly_kept_ = true;
    std::vector<Change> changes = after_last_kept_cut();
    switch (up_to_a_byte ? rng_() % 5 : 2 + rng_() % 3) {
      case 0:  // nothing
        return;
      case 1:  // in order, cut off at any byte
        keep_prefix(changes);
        return;
      case 2:  // whole writes, in any order
        std::ranges::shuffle(changes, rng_);
        break;
      default:  // sectors, in any order
        changes = sectors_of(changes);
        std::ranges::shuffle(changes, rng_);
    }
    const std::uint64_t most = rng_() % 3 == 0 ? 99 : rng_() % 101;
    for (const Change& change : changes) {
      if (rng_() % 100 >= most) {
        if (rng_() % 4 == 0) put_junk(change);
        continue;
      }
      put(change.offset, change.bytes);
    }
    if (rng_() % 3 == 0 && durable_.size() < current_.size()) durable_.resize(current_.size());  // zeros
  }

  /// A cut may reach the disk or not, like all else; once it has, what was written before it is gone for
  /// good.
  std::vector<Change> after_last_kept_cut() {
    for (std::size_t i = pending_.size(); i-- > 0;) {
      if (!pending_[i].cut || rng_() % 2 == 0) continue;
      if (durable_.size() > pending_[i].offset) durable_.resize(pending_[i].offset);
      pending_.erase(pending_.begin(), pending_.begin() + static_cast<std::ptrdiff_t>(i) + 1);
      break;
    }
    std::vector<Change> changes = pending_;
    std::erase_if(changes, [](const Change& change) { return change.cut; });
    return changes;
  }

  void keep_prefix(const std::vector<Change>& changes) {
    std::uint64_t total = 0;
    for (const Change& change : changes) total += change.bytes.size() + 1;
    std::uint64_t left = total == 0 ? 0 : rng_() % (total + 1);
    for (const Change& change : changes) {
      if (left == 0) return;
      const std::uint64_t part = std::min<std::uint64_t>(left - 1, change.bytes.size());
      put(change.offset, format::Bytes(change.bytes).first(part));
      left -= std::min<std::uint64_t>(left, change.bytes.size() + 1);
    }
  }

  /// The file grew, but the sector holds what was there before it belonged to the file.
  void put_junk(const Change& change) {
    std::vector<std::byte> junk(change.bytes.size());
    for (std::byte& b : junk) b = static_cast<std::byte>(rng_());
    if (change.offset >= durable_.size()) put(change.offset, junk);
  }

  static std::vector<Change> sectors_of(const std::vector<Change>& changes) {
    constexpr std::uint64_t kSector = 512;
    std::vector<Change> sectors;
    for (const Change& change : changes) {
      for (std::uint64_t at = 0; at < change.bytes.size();) {
        const std::uint64_t bytes =
            std::min<std::uint64_t>(change.bytes.size() - at, kSector - (change.offset + at) % kSector);
        const auto from = change.bytes.begin() + static_cast<std::ptrdiff_t>(at);
        sectors.push_back({change.offset + at, {from, from + static_cast<std::ptrdiff_t>(bytes)}, false});
        at += bytes;
      }
    }
    return sectors;
  }

  std::vector<std::byte> durable_, current_;
  std::vector<Change> pending_;
  Fault fault_ = Fault::kNone;
  std::uint64_t countdown_ = 0;
  std::uint64_t calls_ = 0, syncs_ = 0;
  bool met_ = false;
  bool partly_kept_ = false;
  std::mt19937_64 rng_;
};

}  // namespace apgm::test
