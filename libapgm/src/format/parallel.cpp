#include "parallel.hpp"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include "apgm/core/budget.hpp"

namespace apgm::format {

void parallel_for(std::size_t n, int threads, const std::function<void(std::size_t)>& work,
                  std::size_t grain) {
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::exception_ptr error;
  std::size_t error_at = n;
  const auto run = [&] {
    for (std::size_t from = next.fetch_add(grain); from < n; from = next.fetch_add(grain)) {
      std::size_t i = from;
      try {
        for (; i < std::min(n, from + grain); ++i) work(i);
      } catch (...) {
        next.store(n);
        const std::scoped_lock lock(mutex);
        if (i < error_at) {
          error_at = i;
          error = std::current_exception();
        }
        return;
      }
    }
  };
  const std::size_t cores = std::max(1u, std::thread::hardware_concurrency());
  const std::size_t wanted = threads <= 0 ? cores : std::min(cores, static_cast<std::size_t>(threads));
  const std::size_t most = std::min(wanted, (n + grain - 1) / grain);
  {
    std::vector<std::jthread> helpers;
    try {
      for (std::size_t t = 1; t < most; ++t) helpers.emplace_back(run);
    } catch (const std::system_error&) {
      // Fewer threads do the same work.
    }
    run();
  }
  if (error) std::rethrow_exception(error);
}

void check_list(std::uint64_t max_bytes, std::uint64_t held, std::uint64_t done, std::uint64_t total) {
  if (max_bytes == 0 || held <= max_bytes) return;
  const double whole = static_cast<double>(held) * static_cast<double>(std::max(done, total)) /
                       static_cast<double>(std::max<std::uint64_t>(done, 1));
  check_budget(max_bytes, static_cast<std::uint64_t>(whole),
               "the list of the file's blocks is held in memory");
}

int decoding_threads(std::uint64_t max_bytes, std::uint64_t held, std::uint64_t layer_bytes, int threads) {
  if (max_bytes == 0) return threads;
  check_list(max_bytes, held, 1, 1);
  const std::uint64_t at_work = 4 * std::max<std::uint64_t>(1, layer_bytes);
  if (at_work > max_bytes - held) {
    throw over_budget("the memory budget does not hold the largest layer while it is decoded",
                      held + at_work);
  }
  const auto most = static_cast<int>(std::min<std::uint64_t>((max_bytes - held) / at_work, 1024));
  return threads == 0 ? most : std::min(most, threads);
}

}  // namespace apgm::format
