#include "apgm/core/map.hpp"

#include <algorithm>
#include <cassert>

#include "apgm/core/error.hpp"

namespace apgm {
namespace {

class MapCursor final : public PatchCursor {
 public:
  MapCursor(const std::map<std::uint64_t, Patch>& patches, std::optional<PatchRange> range)
      : it_(patches.begin()), end_(patches.end()), range_(range) {}

  bool next(PatchInfo& out) override {
    while (it_ != end_ && range_ && !range_->contains(it_->second.index)) ++it_;
    if (it_ == end_) return false;
    const Patch& patch = it_->second;
    out.patch = patch.index;
    out.layers.clear();
    for (const auto& [type, layer] : patch.layers) {
      LayerInfo info;
      info.patch = patch.index;
      info.type = type;
      info.step = static_cast<std::uint8_t>(layer.step());
      info.stamp_ns = layer.stamp_ns;
      out.layers.push_back(info);
    }
    ++it_;
    return true;
  }

 private:
  std::map<std::uint64_t, Patch>::const_iterator it_, end_;
  std::optional<PatchRange> range_;
};

}  // namespace

Map::Map(MapHeader header) : header_(std::move(header)) { header_.frame.check(); }

Patch& Map::patch(PatchIndex index) {
  Patch& p = patches_[curve_key(index)];
  p.index = index;
  return p;
}

const Patch* Map::find(PatchIndex index) const {
  const auto it = patches_.find(curve_key(index));
  return it == patches_.end() ? nullptr : &it->second;
}

Layer& Map::layer(PatchIndex index, TypeId type, int step) {
  assert(type < header_.types.size());
  Patch& p = patch(index);
  const auto it = p.layers.find(type);
  if (it != p.layers.end()) return it->second;
  return p.layers.emplace(type, Layer(header_.types[type], step)).first->second;
}

const Layer* Map::find(PatchIndex index, TypeId type) const {
  const Patch* p = find(index);
  if (p == nullptr) return nullptr;
  const auto it = p->layers.find(type);
  return it == p->layers.end() ? nullptr : &it->second;
}

void Map::prune() {
  for (auto& [key, patch] : patches_) {
    std::erase_if(patch.layers, [&](const auto& l) { return is_vacuous(l.second, header_.types[l.first]); });
  }
  std::erase_if(patches_, [](const auto& p) { return p.second.layers.empty(); });
}

std::optional<Layer> Map::extract(PatchIndex index, TypeId type) {
  const auto patch = patches_.find(curve_key(index));
  if (patch == patches_.end()) return {};
  auto node = patch->second.layers.extract(type);
  if (patch->second.layers.empty()) patches_.erase(patch);
  if (node.empty()) return {};
  return std::move(node.mapped());
}

void Map::set_types(const TypeTable& types) {
  const std::vector<TypeId> ids = matching_ids(header_.types, types);
  for (auto& [key, patch] : patches_) {
    std::map<TypeId, Layer> layers;
    for (auto& [type, layer] : patch.layers) layers.emplace(ids[type], std::move(layer));
    patch.layers = std::move(layers);
  }
  header_.types = types;
}

Summary Map::summary() const {
  Summary s;
  s.patches = patches_.size();
  s.types.resize(header_.types.size());
  for (const auto& [key, patch] : patches_) {
    s.range.add(patch.index);
    for (const auto& [type, layer] : patch.layers) {
      auto& t = s.types[type];
      ++t.layers;
      ++t.layers_at[static_cast<std::size_t>(layer.step())];
      t.raw_bytes += layer.value_bytes();
    }
  }
  return s;
}

std::unique_ptr<PatchCursor> Map::patches(const std::optional<PatchRange>& range) const {
  return std::make_unique<MapCursor>(patches_, range);
}

void Map::load(const LayerInfo& info, Layer& out) const {
  const Layer* layer = find(info.patch, info.type);
  if (layer == nullptr) throw Error(ErrorCode::kInvalidArgument, "the map has no such layer");
  out = *layer;
}

void MapSink::pack(Parcel& parcel) const {
  assert(parcel.state == Parcel::State::kCells);
  const LayerType& type = map_.header().types[parcel.type];
  canonicalise(parcel.cells, type);
  if (is_vacuous(parcel.cells, type)) parcel.state = Parcel::State::kNothing;
}

void MapSink::put(PatchIndex index, std::span<Parcel> parcels) {
  for (Parcel& parcel : parcels) {
    if (parcel.state == Parcel::State::kNothing) continue;
    parcel.cells.stamp_ns = parcel.stamp_ns;
    map_.patch(index).layers.insert_or_assign(parcel.type, parcel.cells);
  }
}

}  // namespace apgm
