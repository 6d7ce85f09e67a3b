#pragma once

#include <cstdint>
#include <functional>

namespace apgm::tools {

/// Memory of the process now, and the most it ever had, as the system counts it: pages that are present.
std::uint64_t resident_bytes();
std::uint64_t peak_memory_bytes();

/// Memory that may still be taken, looked at anew with each call; an empty function: no bound.
using MemoryLeft = std::function<std::uint64_t()>;

/// From here on large blocks have pages of their own, which go back to the system when they are freed. For
/// runs with a bound of memory: a bound holds for what the process has, not for what it uses.
void give_large_blocks_pages_of_their_own();
/// Gives free memory back to the system.
void give_back_free_memory();

}  // namespace apgm::tools
