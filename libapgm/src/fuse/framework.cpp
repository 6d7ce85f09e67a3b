#include "apgm/fuse/framework.hpp"

#include <algorithm>
#include <cassert>
#include <map>
#include <string>

#include "apgm/core/error.hpp"

namespace apgm {
namespace {

/// What the tables say of one name.
struct Joined {
  LayerType type;
  int exclusive = 0;  // tables that declare kExclusive
};

void join(Joined& known, const LayerType& type) {
  const auto fail = [&](const std::string& what) {
    throw Error(ErrorCode::kIncompatible,
                "layer type '" + type.name + "' differs between the maps in its " + what);
  };
  if (type.hypotheses != known.type.hypotheses) fail("hypotheses");
  if (type.channels != known.type.channels) fail("channels");
  if (type.slab != known.type.slab) fail("height interval");
  if (type.policy == Policy::kExclusive) {
    ++known.exclusive;
    return;
  }
  if (known.type.policy == Policy::kExclusive) known.type.policy = type.policy;
  if (known.type.policy != type.policy) fail("resampling policy");
}

}  // namespace

TypeTable fused_types(std::span<const TypeTable* const> tables) {
  std::map<std::string, Joined> by_name;
  for (const TypeTable* table : tables) {
    for (const LayerType& type : *table) {
      const auto [it, added] =
          by_name.try_emplace(type.name, Joined{type, type.policy == Policy::kExclusive});
      if (!added) join(it->second, type);
    }
  }
  std::vector<LayerType> types;
  for (auto& [name, joined] : by_name) {
    if (joined.type.policy == Policy::kExclusive && joined.exclusive > 1) {
      joined.type.policy = Policy::kConditional;
    }
    types.push_back(std::move(joined.type));
  }
  return TypeTable(std::move(types));
}

}  // namespace apgm
