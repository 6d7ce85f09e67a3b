#include "stream_numbers.hpp"

#include <algorithm>
#include <iterator>

namespace apgm::format {

std::map<std::uint64_t, std::uint64_t>::const_iterator Numbers::gap_of(std::uint64_t number) const {
  auto it = gaps_.upper_bound(number);
  if (it == gaps_.begin()) return gaps_.end();
  --it;
  return it->second >= number ? it : gaps_.end();
}

Numbers::Arrival Numbers::look(std::uint64_t number) const {
  if (number > greatest_ || gap_of(number) != gaps_.end()) return Arrival::kNew;
  return number <= floor_ ? Arrival::kLate : Arrival::kDuplicate;
}

void Numbers::add_gap(std::uint64_t first, std::uint64_t last) {
  gaps_.emplace(first, last);
  if (gaps_.size() <= kMostGaps) return;
  const auto oldest = gaps_.begin();
  given_up_ += oldest->second - oldest->first + 1;
  floor_ = oldest->second;
  gaps_.erase(oldest);
}

void Numbers::add(std::uint64_t number) {
  if (number > greatest_) {
    const std::uint64_t skipped = number - greatest_ - 1;
    missing_ += skipped;
    if (skipped > 0) add_gap(greatest_ + 1, number - 1);
    greatest_ = number;
    return;
  }
  const auto it = gap_of(number);
  const auto [first, last] = *it;
  gaps_.erase(it);
  --missing_;
  if (first < number) gaps_.emplace(first, number - 1);
  if (number < last) add_gap(number + 1, last);
}

void Numbers::remove(std::uint64_t number) {
  if (number <= floor_) return;
  ++missing_;
  const auto after = gaps_.find(number + 1);
  const std::uint64_t last = after == gaps_.end() ? number : after->second;
  if (after != gaps_.end()) gaps_.erase(after);
  const auto before = gap_of(number - 1);
  if (before == gaps_.end()) return add_gap(number, last);
  gaps_[before->first] = last;
}

std::uint64_t Numbers::missing(std::uint64_t first, std::uint64_t last) const {
  std::uint64_t count = first <= floor_ ? std::min(given_up_, floor_ - first + 1) : 0;
  for (const auto& [from, to] : gaps_) {
    if (from <= last && to >= first) count += std::min(to, last) - std::max(from, first) + 1;
  }
  return count;
}

}  // namespace apgm::format
