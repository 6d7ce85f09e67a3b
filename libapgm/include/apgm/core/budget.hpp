#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "apgm/core/error.hpp"

namespace apgm {

/// The failure of an operation that a memory budget does not hold: Error{kLimit}. Thrown before the memory is
/// taken. The hint starts with "allow at least N MiB", and goes on with `else_do` if that is not empty.
/// @param what         "the memory budget does not hold one patch at work"
/// @param least_bytes  a budget that holds it
Error over_budget(std::string what, std::uint64_t least_bytes, const std::string& else_do = {});

/// Checks that a budget holds what is about to be taken.
/// @param max_bytes  0: no bound
/// @param what       "'a.png' is held in memory as a whole"
/// @throws over_budget() that says how much `need` is
void check_budget(std::uint64_t max_bytes, std::uint64_t need, const std::string& what,
                  const std::string& else_do = {});

/// The hint of over_budget, taken apart.
struct BudgetHint {
  std::uint64_t least_mebibytes = 0;
  std::string_view rest;  ///< what follows the size
};
/// nullopt if the hint is not one of over_budget.
std::optional<BudgetHint> budget_hint(const Error& error);

}  // namespace apgm
