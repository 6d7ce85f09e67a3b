#pragma once

#include <cstdint>
#include <string>

#include "apgm/core/budget.hpp"
#include "apgm/core/error.hpp"

namespace apgm::converters {

/// A whole file as bytes.
/// @param max_bytes  larger files are refused before memory is taken
/// @throws Error{kUnreadable} if it cannot be read or is no regular file, {kLimit} if it is too large
std::string read_file(const std::string& path, std::uint64_t max_bytes);
/// The same for a file that is held as a whole within a memory budget; 0: no bound.
/// @param beside  bytes that are needed beside the file at least
/// @throws over_budget() before memory is taken
std::string read_file_within(const std::string& path, std::uint64_t max_memory_bytes,
                             std::uint64_t beside = 0);
/// What is left of a bound; at least 1, and 0 where there is none.
std::uint64_t budget_left(std::uint64_t max_memory_bytes, std::uint64_t used);

/// The extension in lower case with its dot: ".bt"; empty if there is none.
std::string extension_of(const std::string& path);

/// Calls `action`; an Error that leaves it names the file, unless the caller's own value is to blame.
template <class Action>
auto naming(const std::string& path, Action action) {
  try {
    return action();
  } catch (Error& error) {
    if (error.code() != ErrorCode::kInvalidArgument) error.at(path);
    throw;
  }
}

}  // namespace apgm::converters
