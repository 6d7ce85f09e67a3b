#include "apgm/format/stream_map.hpp"

#include <map>
#include <utility>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/format/content_id.hpp"
#include "apgm/format/scratch_map.hpp"
#include "layer_block.hpp"

namespace apgm {

using namespace format;

namespace {

constexpr int kLevel = 3;  // zstd

/// The place of `type`, of another table, in `types`.
std::optional<TypeId> fitting(const LayerType& type, const TypeTable& types) {
  const auto id = types.find(type.name);
  return id && type.same_meaning(types[*id]) ? id : std::nullopt;
}

}  // namespace

struct StreamMap::State {
  explicit State(std::string dir) : directory(std::move(dir)) { clear({}); }

  std::string directory;
  std::unique_ptr<ScratchMap> map;
  bool has_header = false;
  std::uint64_t unusable = 0;
  std::optional<std::string> base;
  std::string said;  // content id by the newest message
  std::uint64_t said_number = 0;
  // When each layer came: by key and name, so that it outlives other headers.
  std::map<std::pair<std::uint64_t, std::string>, std::pair<PatchIndex, std::uint64_t>> numbers;
  Layer cells;
  Parcel parcel;

  void clear(const MapHeader& header) {
    map = std::make_unique<ScratchMap>(header, directory);
    numbers.clear();
  }

  void keep(std::uint64_t number) {
    map->put(parcel);
    const std::string& name = map->header().types[parcel.type].name;
    numbers[{curve_key(parcel.patch), name}] = {parcel.patch, number};
  }

  /// Takes a layer of a source as it stands; `parcel` counts in its types.
  void copy(const PatchSource& source, const LayerInfo& info) {
    parcel.patch = info.patch;
    parcel.type = info.type;
    parcel.stamp_ns = info.stamp_ns;
    parcel.state = Parcel::State::kStored;
    if (!source.load_stored(info, parcel.stored)) {
      parcel.state = Parcel::State::kCells;
      source.load(info, parcel.cells);
      pack_layer(parcel, source.header().types[info.type], kLevel, Lossy::kNone);
    }
    if (parcel.state == Parcel::State::kStored) keep(0);
  }

  void erase(PatchIndex patch, const LayerType& type) {
    if (const auto id = map->header().types.find(type.name)) map->erase(patch, *id);
    numbers.erase({curve_key(patch), type.name});
  }

  template <typename Condition>
  void erase_if(Condition condition) {
    for (auto it = numbers.begin(); it != numbers.end();) {
      const auto now = it++;
      const auto id = map->header().types.find(now->first.second);
      if (!condition(map->header().types[*id], now->second.second)) continue;
      map->erase(now->second.first, *id);
      numbers.erase(now);
    }
  }

  void take(const StreamLayer& layer) {
    const LayerType& type = layer.header.types[layer.info.type];
    const auto id = fitting(type, map->header().types);
    if (!id || layer.header.frame != map->header().frame) {
      ++unusable;
      return;
    }
    try {
      decode(layer, cells);
    } catch (const Error&) {
      ++unusable;
      return;
    }
    parcel.patch = layer.info.patch;
    parcel.type = *id;
    parcel.stamp_ns = layer.info.stamp_ns;
    parcel.state = Parcel::State::kStored;
    parcel.stored = layer.stored;
    keep(layer.number);
  }
};

StreamMap::StreamMap(std::string directory) : state_(std::make_unique<State>(std::move(directory))) {}
StreamMap::~StreamMap() = default;

void StreamMap::start_from(const PatchSource& base) {
  state_->clear(base.header());
  state_->has_header = true;
  PatchInfo patch;
  for (const auto cursor = base.patches(); cursor->next(patch);) {
    for (const LayerInfo& info : patch.layers) state_->copy(base, info);
  }
}

void StreamMap::header(const MapHeader& header) {
  State& s = *state_;
  s.has_header = true;
  if (header.frame != s.map->header().frame) return s.clear(header);
  s.erase_if([&](const LayerType& type, std::uint64_t) { return !fitting(type, header.types); });
  s.map->set_header(header);
}

void StreamMap::layer(const StreamLayer& layer) { state_->take(layer); }

void StreamMap::gone(const StreamGone& gone) {
  if (gone.header.frame != state_->map->header().frame) return;
  state_->erase(gone.patch, gone.header.types[gone.type]);
}

void StreamMap::end(const StreamEnd& end) {
  State& s = *state_;
  if (!s.base) s.base = end.ids.base;
  if (end.number > s.said_number) {
    s.said = end.ids.result;
    s.said_number = end.number;
  }
  if (!end.whole || end.missing > 0) return;
  s.erase_if([&](const LayerType&, std::uint64_t number) { return number < end.first; });
}

bool StreamMap::has_header() const { return state_->has_header; }
std::uint64_t StreamMap::unusable() const { return state_->unusable; }

const std::string& StreamMap::base() const {
  static const std::string none;
  return state_->base ? *state_->base : none;
}

const std::string& StreamMap::result() const { return state_->said; }

std::optional<bool> StreamMap::is_as_said() const {
  if (state_->said.empty()) return {};
  return state_->said == content_id();
}

const MapHeader& StreamMap::header() const { return state_->map->header(); }
Summary StreamMap::summary() const { return state_->map->summary(); }
std::unique_ptr<PatchCursor> StreamMap::patches(const std::optional<PatchRange>& range) const {
  return state_->map->patches(range);
}
void StreamMap::load(const LayerInfo& info, Layer& out) const { state_->map->load(info, out); }
bool StreamMap::load_stored(const LayerInfo& info, StoredLayer& out) const {
  return state_->map->load_stored(info, out);
}
std::string StreamMap::content_id() const { return content_id_of(*state_->map); }

}  // namespace apgm
