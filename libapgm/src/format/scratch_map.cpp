#include "apgm/format/scratch_map.hpp"

#include <algorithm>
#include <exception>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "apgm/core/error.hpp"
#include "block.hpp"
#include "codec.hpp"
#include "layer_block.hpp"
#include "map_header.hpp"
#include "scratch_file.hpp"

namespace apgm {

using namespace format;

namespace {

/// Below this, dead space is not worth moving anything for.
constexpr std::uint64_t kLeastDead = std::uint64_t{1} << 20;

/// Place of a layer: patches in key order, their layers by type.
struct Place {
  std::uint64_t key = 0;
  TypeId type = 0;
  friend auto operator<=>(const Place&, const Place&) = default;
};

struct Entry {
  PatchIndex patch;
  std::uint64_t offset = 0;
  std::uint64_t stored_hash = 0;
  std::uint64_t content_hash = 0;
  std::int64_t stamp_ns = 0;
  std::uint32_t bytes = 0;
  float error_bound = 0;
  std::uint8_t step = 0;
  std::uint8_t encoding = 0;
};

using Index = std::map<Place, Entry>;

Entry entry_of(PatchIndex patch, std::uint64_t offset, std::int64_t stamp_ns, const StoredLayer& stored) {
  Entry e;
  e.patch = patch;
  e.offset = offset;
  e.stored_hash = hash_of(stored.bytes);
  e.content_hash = stored.content_hash;
  e.stamp_ns = stamp_ns;
  e.bytes = static_cast<std::uint32_t>(stored.bytes.size());
  e.error_bound = stored.error_bound;
  e.step = stored.step;
  e.encoding = stored.encoding;
  return e;
}

/// The layers of one patch in the index.
std::pair<Index::const_iterator, Index::const_iterator> layers_of(const Index& index, std::uint64_t key) {
  auto first = index.lower_bound({key, 0});
  auto last = first;
  while (last != index.end() && last->first.key == key) ++last;
  return {first, last};
}

class ScratchCursor final : public PatchCursor {
 public:
  ScratchCursor(const Index& index, std::optional<PatchRange> range)
      : at_(index.begin()), end_(index.end()), range_(range) {}

  bool next(PatchInfo& out) override {
    while (at_ != end_ && range_ && !range_->contains(at_->second.patch)) ++at_;
    if (at_ == end_) return false;
    out.patch = at_->second.patch;
    out.layers.clear();
    for (const std::uint64_t key = at_->first.key; at_ != end_ && at_->first.key == key; ++at_) {
      const Entry& e = at_->second;
      out.layers.push_back(
          {e.patch, at_->first.type, e.step, e.encoding, e.bytes, e.content_hash, e.stamp_ns, e.offset});
    }
    return true;
  }

 private:
  Index::const_iterator at_, end_;
  std::optional<PatchRange> range_;
};

}  // namespace

struct ScratchMap::State {
  State(MapHeader map_header, const std::string& directory, int zstd_level)
      : header(std::move(map_header)), level(zstd_level), file(std::make_unique<ScratchFile>(directory)) {}

  MapHeader header;
  int level;
  std::unique_ptr<ScratchFile> file;
  Index index;
  std::uint64_t end = 0;   // of the file
  std::uint64_t live = 0;  // bytes of layers in the index
  std::uint64_t most_dead = kLeastDead;
  StoredLayer stored;  // on its way into the file or out of it

  /// Writes the layers of a patch behind the end of the file.
  std::vector<std::pair<Place, Entry>> write_all(const Patch& patch) {
    std::uint64_t at = end;
    std::vector<std::pair<Place, Entry>> made;
    for (const auto& [type, layer] : patch.layers) {
      const LayerType& layer_type = header.types[type];
      // Layers of a live map are canonical: a copy of the cells is memory for nothing.
      Layer copy;
      const bool canonical = is_canonical(layer, layer_type);
      if (!canonical) canonicalise(copy = layer, layer_type);
      const Layer& cells = canonical ? layer : copy;
      if (is_vacuous(cells, layer_type)) continue;
      encode(cells, layer_type, level, Lossy::kNone, stored);
      file->write(at, stored.bytes);
      made.push_back({{curve_key(patch.index), type}, entry_of(patch.index, at, layer.stamp_ns, stored)});
      at += stored.bytes.size();
    }
    return made;
  }

  void forget(std::uint64_t key) {
    const auto [first, last] = layers_of(index, key);
    for (auto it = first; it != last; ++it) live -= it->second.bytes;
    index.erase(first, last);
    if (live == 0) reclaim();
  }

  bool erase(Place place) {
    const auto it = index.find(place);
    if (it == index.end()) return false;
    live -= it->second.bytes;
    index.erase(it);
    reclaim();
    return true;
  }

  void put(const Parcel& parcel) {
    const StoredLayer& layer = parcel.stored;
    file->write(end, layer.bytes);
    const Place place{curve_key(parcel.patch), parcel.type};
    const auto [it, is_new] = index.try_emplace(place);
    if (!is_new) live -= it->second.bytes;
    it->second = entry_of(parcel.patch, end, parcel.stamp_ns, layer);
    end += layer.bytes.size();
    live += layer.bytes.size();
    reclaim();
  }

  /// Takes what write_all made, in place of what there was of the patch.
  void replace(std::uint64_t key, const std::vector<std::pair<Place, Entry>>& made) {
    for (const auto& [place, entry] : made) {
      end += entry.bytes;
      live += entry.bytes;
    }
    forget(key);
    index.insert(made.begin(), made.end());
    reclaim();
  }

  /// Writes all layers into a new file, in the order they lie in, and goes on with that one. Until it is
  /// complete the old file stays as it is, and an error leaves all as it was: then more must be dead before
  /// the next attempt. Less is moved than was written since the last time.
  void compact() {
    std::vector<std::pair<Entry*, std::uint64_t>> moves;
    moves.reserve(index.size());
    for (auto& [place, entry] : index) moves.emplace_back(&entry, 0);
    std::ranges::sort(moves, {}, [](const auto& move) { return move.first->offset; });
    auto fresh = std::make_unique<ScratchFile>(file->directory());
    std::uint64_t to = 0;
    for (auto& [entry, offset] : moves) {
      stored.bytes.resize(entry->bytes);
      file->read(entry->offset, stored.bytes);
      fresh->write(to, stored.bytes);
      offset = std::exchange(to, to + entry->bytes);
    }
    for (const auto& [entry, offset] : moves) entry->offset = offset;
    file = std::move(fresh);
    end = to;
  }

  void reclaim() {
    if (live == 0) {
      end = 0;
      file->truncate(0);
      most_dead = kLeastDead;
    } else if (end - live > std::max(live, most_dead)) {
      try {
        compact();
        most_dead = kLeastDead;
      } catch (const std::exception&) {
        most_dead = 2 * (end - live);  // dead space is no reason to fail: all layers are where they were
      }
    }
  }

  /// Bytes of a layer, checked.
  const Entry& read(PatchIndex patch, TypeId type, std::vector<std::byte>& out) const {
    const auto it = index.find({curve_key(patch), type});
    if (it == index.end()) throw Error(ErrorCode::kInvalidArgument, "the scratch map has no such layer");
    const Entry& e = it->second;
    out.resize(e.bytes);
    file->read(e.offset, out);
    if (hash_of(out) != e.stored_hash) fail_damaged(e, type);
    return e;
  }

  void decode_layer(PatchIndex patch, TypeId type, std::vector<std::byte>& buffer, Layer& out) const {
    const Entry& e = read(patch, type, buffer);
    decode(static_cast<Encoding>(e.encoding), e.step, buffer, header.types[type], out);
    out.stamp_ns = e.stamp_ns;
    out.error_bound = e.error_bound;
  }

  [[noreturn]] void fail_damaged(const Entry& e, TypeId type) const {
    throw Error(ErrorCode::kDamaged, "the scratch file in '" + file->directory() + "' lost layer '" +
                                         header.types[type].name + "' of patch (" +
                                         std::to_string(e.patch.x) + "," + std::to_string(e.patch.y) + ")")
        .hint("the disk or the memory of this machine may be failing")
        .at(file->directory(), e.offset);
  }
};

ScratchMap::ScratchMap(MapHeader header, const std::string& directory, int level) {
  check_level(level);
  header.frame.check();
  state_ = std::make_unique<State>(std::move(header), directory, level);
}

ScratchMap::~ScratchMap() = default;

std::uint64_t ScratchMap::working_bytes(std::uint64_t layer_bytes, int level) {
  constexpr std::uint64_t kBuffers = 4;  // values, a frame and a body of the codec; the stored layer
  return kBuffers * layer_bytes + pack_memory(layer_bytes, level);
}

void ScratchMap::set_types(const TypeTable& types) {
  State& s = *state_;
  const TypeTable& old = s.header.types;
  std::map<TypeId, TypeId> ids;  // of types that layers rest of
  for (const auto& [place, entry] : s.index) ids.emplace(place.type, place.type);
  for (auto& [from, to] : ids) to = matching_ids(TypeTable({old[from]}), types)[0];
  Index index;
  for (const auto& [place, entry] : s.index) index.emplace(Place{place.key, ids[place.type]}, entry);
  s.index.swap(index);
  s.header.types = types;
}

void ScratchMap::set_header(MapHeader header) {
  if (header.frame != state_->header.frame) {
    throw Error(ErrorCode::kIncompatible, "the layers of a scratch map cannot take another frame");
  }
  set_types(header.types);
  state_->header = std::move(header);
}

void ScratchMap::store(const Patch& patch) {
  const auto made = state_->write_all(patch);
  state_->replace(curve_key(patch.index), made);
}

bool ScratchMap::take(PatchIndex index, Patch& out) {
  State& s = *state_;
  const auto [first, last] = layers_of(s.index, curve_key(index));
  if (first == last) return false;
  std::map<TypeId, Layer> layers;
  for (auto it = first; it != last; ++it) {
    s.decode_layer(index, it->first.type, s.stored.bytes, layers[it->first.type]);
  }
  out.index = index;
  out.layers = std::move(layers);
  s.forget(curve_key(index));
  return true;
}

void ScratchMap::put(const Parcel& parcel) { state_->put(parcel); }

bool ScratchMap::erase(PatchIndex patch, TypeId type) { return state_->erase({curve_key(patch), type}); }

std::uint64_t ScratchMap::layers() const { return state_->index.size(); }

std::uint64_t ScratchMap::file_bytes() const { return state_->end; }

const MapHeader& ScratchMap::header() const { return state_->header; }

Summary ScratchMap::summary() const {
  Summary summary;
  summary.types.resize(state_->header.types.size());
  std::optional<std::uint64_t> last;
  for (const auto& [place, entry] : state_->index) {
    if (last != place.key) {
      ++summary.patches;
      summary.range.add(entry.patch);
    }
    last = place.key;
    Summary::OfType& t = summary.types[place.type];
    ++t.layers;
    ++t.layers_at[entry.step];
    t.stored_bytes += entry.bytes;
    t.raw_bytes += (std::uint64_t{4} << (2 * entry.step)) * state_->header.types[place.type].channels.size();
  }
  return summary;
}

std::unique_ptr<PatchCursor> ScratchMap::patches(const std::optional<PatchRange>& range) const {
  return std::make_unique<ScratchCursor>(state_->index, range);
}

void ScratchMap::load(const LayerInfo& info, Layer& out) const {
  thread_local std::vector<std::byte> buffer;
  state_->decode_layer(info.patch, info.type, buffer, out);
}

bool ScratchMap::load_stored(const LayerInfo& info, StoredLayer& out) const {
  const Entry& e = state_->read(info.patch, info.type, out.bytes);
  out.encoding = e.encoding;
  out.step = e.step;
  out.content_hash = e.content_hash;
  out.error_bound = e.error_bound;
  return true;
}

}  // namespace apgm
