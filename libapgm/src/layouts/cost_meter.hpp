#pragma once

#include <bit>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "apgm/layouts/cost.hpp"

namespace apgm::layouts {

/// Draws cells of parts that hold different numbers of them, each cell as likely as any other. The same draws
/// on every platform (splitmix64).
class CellDraws {
 public:
  explicit CellDraws(std::uint64_t seed) : state_(seed) {}
  void add_part(std::uint64_t cells) {
    first_.push_back(count_);
    count_ += cells;
  }
  std::uint64_t count() const { return count_; }
  /// A part and the number of a cell in it. REQUIRES: count() > 0
  std::pair<std::size_t, std::uint64_t> draw();

 private:
  std::uint64_t state_;
  std::vector<std::uint64_t> first_;  // number of a part's first cell
  std::uint64_t count_ = 0;
};

/// Keeps what is read from being optimised away. Not a sum of floats: its chain of additions would cost more
/// than the memory.
class ReadBits {
 public:
  ReadBits() = default;
  ~ReadBits() { static_cast<void>(*static_cast<volatile std::uint32_t*>(&bits_)); }
  ReadBits(const ReadBits&) = delete;
  ReadBits& operator=(const ReadBits&) = delete;
  void add(float value) { bits_ ^= std::bit_cast<std::uint32_t>(value); }

 private:
  std::uint32_t bits_ = 0;
};

/// The clock of the options, or the machine's.
class Stopwatch {
 public:
  /// @throws Error{kInvalidArgument} if a number of the options is below 1
  explicit Stopwatch(const CostOptions& options);
  template <class Work>
  double time_ns(Work&& work) const {
    const std::int64_t start = now_ns_();
    work();
    return static_cast<double>(now_ns_() - start);
  }

 private:
  std::function<std::int64_t()> now_ns_;
};

/// What is timed, one call each but `insert`, which comes twice.
struct Accesses {
  std::function<void()> snapshot;  ///< makes the copy that the others write to
  std::function<void()> find;
  std::function<void()> iterate;
  std::function<void()> insert;
  std::uint64_t cells = 0;
};

/// Snapshot, find, iterate and insert of a cost, in this order.
LayoutCost time_accesses(const Stopwatch& watch, const CostOptions& options, const Accesses& accesses);

}  // namespace apgm::layouts
