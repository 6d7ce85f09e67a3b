#include "apgm/core/map_changes.hpp"

#include "apgm/core/error.hpp"

namespace apgm {
namespace {

/// The types of both; those of `second` stand where both have one of a name.
TypeTable joined(const TypeTable& first, const TypeTable& second) {
  std::vector<LayerType> types(second.begin(), second.end());
  for (const LayerType& type : first) {
    if (!second.find(type.name)) types.push_back(type);
  }
  return TypeTable(std::move(types));
}

}  // namespace

void apply(const MapChanges& changes, Map& map) {
  const MapHeader& header = changes.changed.header();
  if (header.frame != map.header().frame) {
    throw Error(ErrorCode::kIncompatible, "the changes are of a map with another frame");
  }
  if (header.types != map.header().types) map.set_types(joined(map.header().types, header.types));
  const TypeTable& types = map.header().types;
  for (const MapChanges::Gone& gone : changes.gone) {
    if (const auto type = types.find(gone.layer)) map.extract(gone.patch, *type);
  }
  const std::vector<TypeId> ids = matching_ids(header.types, types);
  for (const auto& [key, patch] : changes.changed.by_key()) {
    for (const auto& [type, layer] : patch.layers) map.patch(patch.index).layers[ids[type]] = layer;
  }
}

}  // namespace apgm
