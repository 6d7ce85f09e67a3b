#include "apgm/format/message.hpp"

#include <charconv>
#include <string_view>
#include <utility>

#include "apgm/core/error.hpp"
#include "apgm/format/reader.hpp"

namespace apgm {
namespace {

constexpr const char* kGoneKey = "apgm.gone";

/// What `gone` breaks of its rules (docs/format.md, "Well-known metadata"); nullptr: nothing.
const char* fault(const std::vector<MapChanges::Gone>& gone, const Map& changed) {
  const auto place = [](const MapChanges::Gone& g) {
    return std::pair<std::uint64_t, const std::string&>(curve_key(g.patch), g.layer);
  };
  for (std::size_t i = 0; i < gone.size(); ++i) {
    const auto type = changed.header().types.find(gone[i].layer);
    if (!type) return "a layer that is gone is of no type of the map";
    if (changed.find(gone[i].patch, *type) != nullptr) return "a layer is both changed and gone";
    if (i > 0 && place(gone[i - 1]) >= place(gone[i])) return "what is gone is not in order";
  }
  return nullptr;
}

std::string to_text(const std::vector<MapChanges::Gone>& gone) {
  std::string text;
  for (const MapChanges::Gone& g : gone) {
    if (!text.empty()) text += ' ';
    text += std::to_string(g.patch.x) + ' ' + std::to_string(g.patch.y) + ' ' + g.layer;
  }
  return text;
}

[[noreturn]] void fail_gone(const std::string& what) {
  throw Error(ErrorCode::kDamaged, "the message cannot be used: " + what);
}

/// Takes words off the front of a text.
class Words {
 public:
  explicit Words(std::string_view text) : rest_(text) {}
  bool empty() const { return rest_.empty(); }
  std::string_view next() {
    const auto end = rest_.find(' ');
    const std::string_view word = rest_.substr(0, end);
    rest_ = end == std::string_view::npos ? std::string_view{} : rest_.substr(end + 1);
    if (word.empty()) fail_gone("its list of what is gone is malformed");
    return word;
  }
  std::int32_t next_number() {
    const std::string_view word = next();
    std::int32_t value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc{} || end != word.data() + word.size()) {
      fail_gone("its list of what is gone is malformed");
    }
    return value;
  }

 private:
  std::string_view rest_;
};

std::vector<MapChanges::Gone> parse_gone(std::string_view text) {
  std::vector<MapChanges::Gone> gone;
  for (Words words(text); !words.empty();) {
    MapChanges::Gone g;
    g.patch.x = words.next_number();
    g.patch.y = words.next_number();
    g.layer = words.next();
    gone.push_back(std::move(g));
  }
  // There is one way to write a list: no other spaces, zeros or signs.
  if (to_text(gone) != text) fail_gone("its list of what is gone is malformed");
  return gone;
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
  if (const char* what = fault(changes.gone, changes.changed)) {
    throw Error(ErrorCode::kInvalidArgument, "the changes cannot be stored: " + std::string(what));
  }
  MapHeader header = changes.changed.header();
  header.metadata.erase(kGoneKey);
  if (!changes.gone.empty()) header.metadata[kGoneKey] = to_text(changes.gone);
  return write(header, changes.changed, options);
}

Map map_from_bytes(std::span<const std::byte> bytes, std::uint64_t max_bytes) {
  const Reader reader(bytes);
  return read_all(reader, reader.header(), max_bytes);
}

MapChanges changes_from_bytes(std::span<const std::byte> bytes, std::uint64_t max_bytes) {
  const Reader reader(bytes);
  MapHeader header = reader.header();
  std::vector<MapChanges::Gone> gone;
  if (const auto text = header.metadata.extract(kGoneKey); !text.empty()) gone = parse_gone(text.mapped());
  MapChanges changes{read_all(reader, std::move(header), max_bytes), std::move(gone)};
  if (const char* what = fault(changes.gone, changes.changed)) fail_gone(what);
  return changes;
}

}  // namespace apgm
