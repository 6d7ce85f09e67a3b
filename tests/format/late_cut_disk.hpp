#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "apgm/core/error.hpp"
#include "append_file.hpp"

namespace apgm::test {

/// Of the disks that CrashDisk stands for the worst for what is cut off: what is written is there at once,
/// what is cut off goes only with a sync that succeeds, and what is written after the cut lies among it till
/// then.
class LateCutDisk final : public format::AppendFile {
 public:
  static constexpr std::uint64_t kNever = std::numeric_limits<std::uint64_t>::max();

  explicit LateCutDisk(std::vector<std::byte> bytes) : durable_(bytes), current_(std::move(bytes)) {}

  /// The next `good` syncs succeed, none after them.
  void fail_syncs_after(std::uint64_t good) { good_syncs_ = good; }
  /// The next `good` calls that change something succeed, none after them.
  void fail_calls_after(std::uint64_t good) { good_calls_ = good; }
  /// The power fails, and the next process finds a disk that works.
  void crash() {
    current_ = durable_;
    good_syncs_ = good_calls_ = kNever;
  }
  /// That succeeded.
  std::uint64_t syncs() const { return syncs_; }
  const std::vector<std::byte>& current() const { return current_; }

  void read(std::uint64_t offset, std::span<std::byte> out) const override {
    if (offset + out.size() > current_.size()) throw Error(ErrorCode::kUnreadable, "past the end");
    std::memcpy(out.data(), current_.data() + offset, out.size());
  }
  std::uint64_t size() const override { return current_.size(); }

  void write(format::Bytes bytes) override {
    use_up(good_calls_);
    const std::size_t at = current_.size();
    current_.insert(current_.end(), bytes.begin(), bytes.end());
    durable_.resize(std::max(durable_.size(), current_.size()));
    std::ranges::copy(bytes, durable_.begin() + static_cast<std::ptrdiff_t>(at));
  }
  void rewrite(std::uint64_t /*offset*/, format::Bytes /*bytes*/) override { use_up(good_calls_); }
  void sync() override {
    use_up(good_calls_);
    use_up(good_syncs_);
    durable_.resize(current_.size());
    ++syncs_;
  }
  void cut(std::uint64_t size) override {
    use_up(good_calls_);
    current_.resize(size);
  }

 private:
  static void use_up(std::uint64_t& good) {
    if (good == 0) throw Error(ErrorCode::kOutput, "a fault of the disk");
    if (good != kNever) --good;
  }

  std::vector<std::byte> durable_, current_;
  std::uint64_t good_syncs_ = kNever, good_calls_ = kNever, syncs_ = 0;
};

}  // namespace apgm::test
