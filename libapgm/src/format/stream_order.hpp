#pragma once

#include <cstdint>
#include <deque>
#include <unordered_map>
#include <utility>

namespace apgm::format {

/// The newest number under which each of the last 65536 layers came: so that no older state follows.
class Order {
 public:
  /// Whether a block of `number` can be judged at all.
  bool knows(std::uint64_t number) const { return number > floor_; }
  /// Takes note that `layer`, by its hash, comes with `number`. @return false if a newer state came before
  bool take(std::uint64_t layer, std::uint64_t number) {
    std::uint64_t& newest = newest_[layer];
    if (newest > number) return false;
    newest = number;
    taken_.emplace_back(layer, number);
    if (taken_.size() > kMost) forget_oldest();
    return true;
  }
  /// All numbers up to `number` arrived: what comes under one of them again is not judged.
  void clear(std::uint64_t number) {
    newest_ = {};  // clearing would take as long as the table once was
    taken_.clear();
    floor_ = number;
  }

 private:
  static constexpr std::size_t kMost = 65'536;

  void forget_oldest() {
    const auto [layer, number] = taken_.front();
    taken_.pop_front();
    if (number > floor_) floor_ = number;
    const auto it = newest_.find(layer);
    if (it != newest_.end() && it->second == number) newest_.erase(it);
  }

  std::unordered_map<std::uint64_t, std::uint64_t> newest_;
  std::deque<std::pair<std::uint64_t, std::uint64_t>> taken_;
  std::uint64_t floor_ = 0;
};

}  // namespace apgm::format
