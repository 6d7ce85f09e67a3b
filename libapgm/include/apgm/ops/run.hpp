#pragma once

#include <atomic>
#include <cstdint>
#include <functional>

#include "apgm/core/error.hpp"

namespace apgm {

/// How an operation runs; shared by all of them.
struct RunOptions {
  int threads = 0;                     ///< 0: all cores; never more than there are
  std::uint64_t max_memory_bytes = 0;  ///< 0: no bound but the number of patches in flight
  std::function<void(std::uint64_t done, std::uint64_t total)>
      progress;                               ///< patches; called from one thread at a time
  const std::atomic<bool>* cancel = nullptr;  ///< looked at before every patch; set: Error{kCancelled}
  Findings findings;  ///< notes, warnings and losses; called from one thread at a time
};

}  // namespace apgm
