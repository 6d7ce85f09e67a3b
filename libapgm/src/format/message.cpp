#include "apgm/format/message.hpp"

#include <algorithm>
#include <utility>

#include "apgm/core/error.hpp"
#include "apgm/format/gone_list.hpp"
#include "apgm/format/reader.hpp"

namespace apgm {
namespace {

/// True if one of `gone` is a layer of `changed`.
bool also_changed(const std::vector<MapChanges::Gone>& gone, const Map& changed) {
  const TypeTable& types = changed.header().types;
  return std::ranges::any_of(
      gone, [&](const auto& g) { return changed.find(g.patch, types.find(g.layer).value()) != nullptr; });
}

/// One layer after the other: a message is small, and this room has no threads.
void stream(const PatchSource& source, PatchSink& sink) {
  const auto cursor = source.patches();
  PatchInfo patch;
  std::vector<Parcel> parcels;
  while (cursor->next(patch)) {
    if (parcels.size() < patch.layers.size()) parcels.resize(patch.layers.size());
    for (std::size_t i = 0; i < patch.layers.size(); ++i) {
      const LayerInfo& info = patch.layers[i];
      Parcel& parcel = parcels[i];
      parcel.patch = info.patch;
      parcel.type = info.type;
      parcel.stamp_ns = info.stamp_ns;
      parcel.state = Parcel::State::kStored;
      if (sink.takes_stored() && source.load_stored(info, parcel.stored)) continue;
      parcel.state = Parcel::State::kCells;
      source.load(info, parcel.cells);
      sink.pack(parcel);
    }
    sink.put(patch.patch, std::span(parcels).first(patch.layers.size()));
  }
  sink.finish();
}

std::vector<std::byte> write(const MapHeader& header, const PatchSource& source,
                             const WriterOptions& options) {
  std::vector<std::byte> bytes;
  Writer writer(bytes, header, options);
  stream(source, writer);
  return bytes;
}

/// Reads all layers into a map with `header`, whose types are the reader's.
Map read_all(const Reader& reader, MapHeader header, std::uint64_t max_bytes) {
  Map map(std::move(header));
  const TypeTable& types = map.header().types;
  const auto cursor = reader.patches();
  PatchInfo patch;
  std::uint64_t bytes = 0;
  while (cursor->next(patch)) {
    for (const LayerInfo& info : patch.layers) {
      bytes += (std::uint64_t{4} << (2 * info.step)) * types[info.type].channels.size();
      if (bytes > max_bytes) {
        throw Error(ErrorCode::kLimit, "the map of the message takes more than " + std::to_string(max_bytes) +
                                           " bytes of memory")
            .hint("save the message to a file, which is read piece by piece");
      }
      reader.load(info, map.patch(info.patch).layers[info.type]);
    }
  }
  return map;
}

}  // namespace

std::vector<std::byte> to_bytes(const PatchSource& map, const WriterOptions& options) {
  return write(map.header(), map, options);
}

std::vector<std::byte> to_bytes(const MapChanges& changes, const WriterOptions& options) {
  MapHeader header = changes.changed.header();
  store_gone(changes.gone, header);
  if (also_changed(changes.gone, changes.changed)) {
    throw Error(ErrorCode::kInvalidArgument,
                "the changes cannot be stored: a layer is both changed and gone");
  }
  return write(header, changes.changed, options);
}

Map map_from_bytes(std::span<const std::byte> bytes, std::uint64_t max_bytes) {
  const Reader reader(bytes);
  return read_all(reader, reader.header(), max_bytes);
}

MapChanges changes_from_bytes(std::span<const std::byte> bytes, std::uint64_t max_bytes) {
  const Reader reader(bytes);
  MapHeader header = reader.header();
  std::vector<MapChanges::Gone> gone = take_gone(header);
  MapChanges changes{read_all(reader, std::move(header), max_bytes), std::move(gone)};
  if (also_changed(changes.gone, changes.changed)) {
    throw Error(ErrorCode::kDamaged, "the message cannot be used: a layer is both changed and gone");
  }
  return changes;
}

}  // namespace apgm
