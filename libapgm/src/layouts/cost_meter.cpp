#include "layouts/cost_meter.hpp"

#include <algorithm>
#include <chrono>

#include "apgm/core/error.hpp"

namespace apgm::layouts {
namespace {

std::int64_t steady_now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

}  // namespace

std::pair<std::size_t, std::uint64_t> CellDraws::draw() {
  std::uint64_t z = (state_ += 0x9e3779b97f4a7c15u);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  const std::uint64_t cell = (z ^ (z >> 31)) % count_;
  const auto part = static_cast<std::size_t>(std::ranges::upper_bound(first_, cell) - first_.begin() - 1);
  return {part, cell - first_[part]};
}

Stopwatch::Stopwatch(const CostOptions& options) : now_ns_(options.now_ns ? options.now_ns : steady_now_ns) {
  if (options.accesses < 1 || options.shifts < 1 || options.growths < 1) {
    throw Error(ErrorCode::kInvalidArgument, "numbers of accesses, shifts and growths are at least 1");
  }
}

LayoutCost time_accesses(const Stopwatch& watch, const CostOptions& options, const Accesses& accesses) {
  LayoutCost cost;
  cost.snapshot_ns = watch.time_ns(accesses.snapshot);
  cost.find_ns = watch.time_ns(accesses.find) / options.accesses;
  cost.iterate_ns = watch.time_ns(accesses.iterate) / static_cast<double>(accesses.cells);
  // A tile with copy on write is copied once: the first round is not measured.
  accesses.insert();
  cost.insert_ns = watch.time_ns(accesses.insert) / options.accesses;
  return cost;
}

}  // namespace apgm::layouts
