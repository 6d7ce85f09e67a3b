#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apgm/ops/diff.hpp"

namespace apgm::ops {

/// Two maps on one grid with one table of types.
struct DiffPlan {
  const PatchSource* reference = nullptr;
  const PatchSource* other = nullptr;
  std::unique_ptr<PatchSource> adapter;  ///< `other` on the grid of the reference, where it is not on it
  TypeTable types;                       ///< of both
  std::vector<std::optional<TypeId>> of_reference,
      of_other;  ///< own id -> id in `types`; empty: filtered out
  std::optional<PatchRange> range;
  std::optional<TypeId> drawn;  ///< DiffOptions::cells_layer
  std::vector<std::string> header_differences;
  std::vector<Finding> findings;
};

/// @throws as diff()
DiffPlan plan_diff(const DiffInput& reference, const DiffInput& other, const DiffOptions& options);

}  // namespace apgm::ops
