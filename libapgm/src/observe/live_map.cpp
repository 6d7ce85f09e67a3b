#include "observe/live_map.hpp"

#include <algorithm>
#include <cassert>
#include <tuple>

#include "apgm/fuse/resample.hpp"

namespace apgm::observe {

LiveMap::LiveMap(MapHeader header, std::size_t spare_bytes)
    : map_(std::move(header)), totals_(map_.header().types.size()), spares_(spare_bytes) {}

void LiveMap::set_types(const TypeTable& types) {
  const std::vector<TypeId> ids = matching_ids(map_.header().types, types);
  map_.set_types(types);
  for (auto& [key, notes] : notes_) {
    for (TypeId& id : notes.changed) id = ids[id];
  }
  decltype(last_look_) look;
  for (const auto& [place, index] : last_look_)
    look.emplace(std::pair{place.first, ids[place.second]}, index);
  last_look_.swap(look);
  std::vector<MapperReport::OfType> totals(types.size());
  for (std::size_t i = 0; i < ids.size(); ++i) totals[ids[i]] = totals_[i];
  totals_.swap(totals);
}

Layer* LiveMap::find(PatchIndex index, TypeId type) {
  if (map_.find(index, type) == nullptr) return nullptr;
  return &map_.patch(index).layers.at(type);
}

void LiveMap::count(TypeId type, const Layer& layer, bool in) {
  MapperReport::OfType& t = totals_[type];
  const std::uint64_t sign = in ? 1 : std::uint64_t(-1);
  t.layers += sign;
  t.cells += sign * layer.cells();
  t.bytes += sign * layer.value_bytes();
}

Layer& LiveMap::insert(PatchIndex index, TypeId type, int step) {
  const LayerType& t = types()[type];
  Layer layer = spares_.take((std::size_t{4} << (2 * step)) * t.channels.size());
  layer.reset(t, step);
  return insert(index, type, std::move(layer));
}

Layer& LiveMap::insert(PatchIndex index, TypeId type, Layer&& layer) {
  const auto [it, added] = map_.patch(index).layers.emplace(type, std::move(layer));
  assert(added);
  count(type, it->second, true);
  mark(index, type);
  return it->second;
}

Layer LiveMap::extract(PatchIndex index, TypeId type) {
  Layer layer = std::move(*map_.extract(index, type));
  count(type, layer, false);
  const auto notes = notes_.find(curve_key(index));
  std::erase(notes->second.changed, type);
  if (map_.find(index) == nullptr) notes_.erase(notes);
  return layer;
}

void LiveMap::resample(PatchIndex index, TypeId type, int step) {
  Layer& layer = *find(index, type);
  const LayerType& t = types()[type];
  Layer out = spares_.take((std::size_t{4} << (2 * step)) * t.channels.size());
  apgm::resample(layer, t, step, out);
  count(type, layer, false);
  count(type, out, true);
  std::swap(layer, out);
  spares_.keep(std::move(out));
  mark(index, type);
}

void LiveMap::mark(PatchIndex index, TypeId type) {
  std::vector<TypeId>& changed = notes_[curve_key(index)].changed;
  if (std::ranges::find(changed, type) == changed.end()) changed.push_back(type);
}

void LiveMap::touch(PatchIndex index, std::uint64_t call) { notes_[curve_key(index)].last_use = call; }

std::vector<PatchIndex> LiveMap::by_last_use(std::uint64_t call) const {
  std::vector<std::tuple<std::uint64_t, std::uint64_t, PatchIndex>> order;
  order.reserve(notes_.size());
  for (const auto& [key, notes] : notes_) {
    const bool in_use = notes.last_use == call;
    order.emplace_back(notes.last_use, in_use ? ~key : key, map_.by_key().at(key).index);
  }
  std::ranges::sort(order);
  std::vector<PatchIndex> indices;
  indices.reserve(order.size());
  for (const auto& entry : order) indices.push_back(std::get<2>(entry));
  return indices;
}

std::vector<PatchIndex> LiveMap::indices() const {
  std::vector<PatchIndex> indices;
  indices.reserve(map_.size());
  for (const auto& [key, patch] : map_.by_key()) indices.push_back(patch.index);
  return indices;
}

MapChanges LiveMap::take_changes() {
  MapChanges changes{Map(map_.header()), {}};
  decltype(last_look_) look;
  for (const auto& [key, patch] : map_.by_key()) {
    for (const auto& [type, layer] : patch.layers) look.emplace(std::pair{key, type}, patch.index);
    for (const TypeId type : notes_.at(key).changed) {
      changes.changed.patch(patch.index).layers[type] = patch.layers.at(type);
    }
    notes_.at(key).changed.clear();
  }
  // Ids ascend with the names of the types.
  for (const auto& [place, index] : last_look_) {
    if (!look.contains(place)) changes.gone.push_back({index, types()[place.second].name});
  }
  last_look_.swap(look);
  return changes;
}

std::uint64_t LiveMap::value_bytes() const {
  std::uint64_t bytes = 0;
  for (const auto& t : totals_) bytes += t.bytes;
  return bytes;
}

}  // namespace apgm::observe
