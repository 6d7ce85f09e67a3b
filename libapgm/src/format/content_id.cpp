#include "apgm/format/content_id.hpp"

#include <vector>

#include "content_id.hpp"
#include "xxh3.hpp"

namespace apgm::format {
namespace {

void feed(XXH3_state_t* state, Bytes bytes) { XXH3_128bits_update(state, bytes.data(), bytes.size()); }

/// Length first, so that no two lists of strings feed the same bytes.
void feed_text(std::vector<std::byte>& out, const std::string& text) {
  const auto size = static_cast<std::uint32_t>(text.size());
  const Bytes head = bytes_of(size);
  out.insert(out.end(), head.begin(), head.end());
  const Bytes body = std::as_bytes(std::span(text));
  out.insert(out.end(), body.begin(), body.end());
}

struct LayerRecord {
  std::int32_t ix, iy;
  std::uint64_t space;
  std::uint64_t step;
  std::uint64_t cells;
};
static_assert(sizeof(LayerRecord) == 32);

struct FrameRecord {
  std::int64_t edge_um, datum_x_um, datum_y_um, epsg;
};
static_assert(sizeof(FrameRecord) == 32);

}  // namespace

std::uint64_t content_hash(const Layer& layer) {
  const auto seed = static_cast<XXH64_hash_t>(layer.step()) | static_cast<XXH64_hash_t>(layer.channels())
                                                                  << 8;
  if (layer.cells() % 16 == 0) {  // planes without gaps
    return XXH3_64bits_withSeed(layer.plane(0).data(), layer.value_bytes(), seed);
  }
  std::vector<float> values;
  for (int c = 0; c < layer.channels(); ++c) {
    const auto plane = layer.plane(c);
    values.insert(values.end(), plane.begin(), plane.end());
  }
  return XXH3_64bits_withSeed(values.data(), values.size() * sizeof(float), seed);
}

std::uint64_t space_hash(const LayerType& type) {
  std::vector<std::byte> bytes;
  feed_text(bytes, type.name);
  for (const auto* names : {&type.hypotheses, &type.channels}) {
    const auto count = static_cast<std::uint32_t>(names->size());
    const Bytes head = bytes_of(count);
    bytes.insert(bytes.end(), head.begin(), head.end());
    for (const auto& name : *names) feed_text(bytes, name);
  }
  if (type.slab) {
    for (const std::int64_t z : {type.slab->z_min_um, type.slab->z_max_um}) {
      const Bytes b = bytes_of(z);
      bytes.insert(bytes.end(), b.begin(), b.end());
    }
  }
  return hash_of(bytes);
}

struct ContentId::State {
  std::unique_ptr<XXH3_state_t, XXH_errorcode (*)(XXH3_state_t*)> xxh{XXH3_createState(), &XXH3_freeState};
  std::vector<std::uint64_t> spaces;
};

ContentId::ContentId(const MapHeader& header) : state_(std::make_unique<State>()) {
  if (state_->xxh == nullptr) throw std::bad_alloc();
  XXH3_128bits_reset(state_->xxh.get());
  for (const LayerType& type : header.types) state_->spaces.push_back(space_hash(type));
  const Frame& f = header.frame;
  const FrameRecord record{f.edge_um, f.datum_x_um, f.datum_y_um, f.epsg.value_or(0)};
  std::vector<std::byte> bytes;
  feed_text(bytes, "apgm content 1");
  feed_text(bytes, f.frame_id);
  feed(state_->xxh.get(), bytes);
  feed(state_->xxh.get(), bytes_of(record));
}

ContentId::~ContentId() = default;

void ContentId::add(PatchIndex patch, TypeId type, std::uint8_t step, std::uint64_t layer_hash) {
  const LayerRecord record{patch.x, patch.y, state_->spaces[type], step, layer_hash};
  feed(state_->xxh.get(), bytes_of(record));
}

std::array<std::byte, 16> ContentId::value() const {
  XXH128_canonical_t canonical;
  XXH128_canonicalFromHash(&canonical, XXH3_128bits_digest(state_->xxh.get()));
  std::array<std::byte, 16> id;
  std::memcpy(id.data(), canonical.digest, sizeof(id));
  return id;
}

std::string to_hex(const std::array<std::byte, 16>& id) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const std::byte b : id) {
    text += kDigits[static_cast<unsigned>(b) >> 4];
    text += kDigits[static_cast<unsigned>(b) & 15];
  }
  return text;
}

}  // namespace apgm::format

namespace apgm {

std::string content_id_of(const PatchSource& source) {
  format::ContentId id(source.header());
  Layer layer;
  PatchInfo patch;
  for (const auto cursor = source.patches(); cursor->next(patch);) {
    for (const LayerInfo& info : patch.layers) {
      std::uint64_t hash = info.content_hash;
      if (hash == 0) {
        const LayerType& type = source.header().types[info.type];
        source.load(info, layer);
        canonicalise(layer, type);
        if (is_vacuous(layer, type)) continue;  // no writer keeps it
        hash = format::content_hash(layer);
      }
      id.add(info.patch, info.type, info.step, hash);
    }
  }
  return format::to_hex(id.value());
}

bool is_content_id(std::string_view text) {
  return text.size() == 32 && text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

}  // namespace apgm
