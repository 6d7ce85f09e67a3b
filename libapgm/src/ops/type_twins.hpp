#pragma once

#include <optional>
#include <vector>

#include "apgm/core/layer_type.hpp"

namespace apgm::ops {

/// What a table has of a type's name.
struct TypeTwin {
  std::optional<TypeId> type;
  bool same_meaning = false;  ///< same space and background: equal cells mean the same in both
};

/// For each type of `from`.
std::vector<TypeTwin> type_twins(const TypeTable& from, const TypeTable& to);

}  // namespace apgm::ops
