#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <utility>
#include <vector>

namespace apgm::format {

/// Calls `work(i)` for each i in [0, n), from several threads, the caller's among them.
/// @param threads  0: all cores; never more than there are
/// @param grain    numbers a thread takes at once
/// @throws what `work` threw first in the order of i; later ones may then not have been called
void parallel_for(std::size_t n, int threads, const std::function<void(std::size_t)>& work,
                  std::size_t grain = 16);

/// Buffers that threads take and give back: as many as work at once, gone with the pool.
template <typename T>
class Spares {
 public:
  /// Calls `work` with a buffer that no other thread has meanwhile.
  template <typename Work>
  auto with(Work work) {
    Loan loan{*this, take()};
    return work(loan.value);
  }

 private:
  struct Loan {
    ~Loan() { pool.give(std::move(value)); }
    Spares& pool;
    T value;
  };
  T take() {
    const std::scoped_lock lock(mutex_);
    if (spare_.empty()) {
      spare_.reserve(++made_);  // so that giving back does not fail
      return T();
    }
    T value = std::move(spare_.back());
    spare_.pop_back();
    return value;
  }
  void give(T value) {
    const std::scoped_lock lock(mutex_);
    spare_.push_back(std::move(value));
  }

  std::mutex mutex_;
  std::vector<T> spare_;
  std::size_t made_ = 0;
};

/// For what walks a file and keeps a list of its blocks: checks what is held after `done` of `total` bytes.
/// @throws over_budget() if a bound of `max_bytes` (0: none) does not hold that; names what the whole list
///         takes if the rest of the file is like the beginning
void check_list(std::uint64_t max_bytes, std::uint64_t held, std::uint64_t done, std::uint64_t total);

/// Threads that may decode layers of up to `layer_bytes` of values at once beside `held` bytes; a codec holds
/// some copies of the layer at hand.
/// @param threads  that were asked for, 0: all cores
/// @throws over_budget() if a bound of `max_bytes` (0: none) has no room for one
int decoding_threads(std::uint64_t max_bytes, std::uint64_t held, std::uint64_t layer_bytes, int threads);

}  // namespace apgm::format
