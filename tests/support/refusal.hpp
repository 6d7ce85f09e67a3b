#pragma once

#include <gtest/gtest.h>

#include "apgm/core/error.hpp"

namespace apgm::test {

/// The code of the Error that `action` throws; a failure of the test if it throws none.
inline ErrorCode refusal(const auto& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.code();
  }
  ADD_FAILURE() << "nothing is refused";
  return {};
}

}  // namespace apgm::test
