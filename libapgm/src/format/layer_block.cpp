#include "layer_block.hpp"

#include <array>
#include <cstring>

#include "apgm/core/error.hpp"
#include "apgm_generated.h"
#include "codec.hpp"
#include "content_id.hpp"

namespace apgm::format {
namespace {

/// FlatBuffer of a layer: a table of a few numbers, with room for fields of later versions.
constexpr std::size_t kMaxLayerMeta = 4096;

[[noreturn]] void fail(const char* what) { throw Error(ErrorCode::kDamaged, what); }

}  // namespace

std::uint64_t value_bytes(const LayerType& type, int step) {
  return (std::uint64_t{4} << (2 * step)) * type.channels.size();
}

std::uint64_t most_stored_bytes(const LayerType& type, int step) {
  const std::uint64_t raw = value_bytes(type, step);
  return raw + raw / 16 + 16'384;
}

void check_level(int level) {
  if (level < 1 || level > 19) {
    throw Error(ErrorCode::kInvalidArgument, "a compression level lies in 1..19");
  }
}

void pack_layer(Parcel& parcel, const LayerType& type, int level, Lossy lossy) {
  if (parcel.state != Parcel::State::kCells) return;
  // Most layers need no change, and reading costs less than writing back.
  if (!keeps_rules(parcel.cells, type)) canonicalise(parcel.cells, type);
  quantise(parcel.cells, type, lossy);
  if (is_vacuous(parcel.cells, type)) {
    parcel.state = Parcel::State::kNothing;
    return;
  }
  encode(parcel.cells, type, level, lossy, parcel.stored);
  parcel.state = Parcel::State::kStored;
}

std::uint64_t pack_memory(std::uint64_t layer_bytes, int level) {
  return frame_memory(layer_bytes + layer_bytes / 16, level);  // values and masks
}

BlockHeader append_layer(std::vector<std::byte>& out, const Parcel& parcel, std::uint64_t commit,
                         std::uint64_t context) {
  const StoredLayer& stored = parcel.stored;
  flatbuffers::FlatBufferBuilder fb(256);
  fb.Finish(fbs::CreateLayer(fb, parcel.patch.x, parcel.patch.y, parcel.type, stored.step, stored.encoding,
                             parcel.stamp_ns, stored.content_hash, stored.error_bound));
  return append_block(out, Kind::kLayer, curve_key(parcel.patch),
                      std::as_bytes(std::span(fb.GetBufferPointer(), fb.GetSize())), stored.bytes, commit,
                      context);
}

LayerBlock read_layer_block(const Block& block) {
  if (block.meta.size() > kMaxLayerMeta) fail("the block is malformed");
  // A block that was found again after damage, or came down a wire, may lie at any address.
  alignas(8) std::array<std::uint8_t, kMaxLayerMeta> meta;
  std::memcpy(meta.data(), block.meta.data(), block.meta.size());
  flatbuffers::Verifier verifier(meta.data(), block.meta.size(), 8, 64);
  if (!verifier.VerifyBuffer<fbs::Layer>(nullptr)) fail("the block is malformed");
  const auto& l = *flatbuffers::GetRoot<fbs::Layer>(meta.data());
  LayerBlock layer;
  layer.info.patch = {l.ix(), l.iy()};
  layer.info.type = l.type();
  layer.info.step = l.step();
  layer.info.encoding = l.encoding();
  layer.info.content_hash = l.content_hash();
  layer.info.stamp_ns = l.stamp_ns();
  layer.error_bound = l.error_bound();
  if (block.header.key != curve_key(layer.info.patch)) fail("the block's key is not that of its patch");
  if (!(layer.error_bound >= 0 && layer.error_bound <= 1)) fail("the error bound is no mass");
  return layer;
}

void decode_layer(const LayerBlock& layer, Bytes body, const LayerType& type, Layer& out) {
  const LayerInfo& info = layer.info;
  decode(static_cast<Encoding>(info.encoding), info.step, body, type, out);
  if (content_hash(out) != info.content_hash) fail("the cells are not those of the content hash");
  if (is_vacuous(out, type)) fail("the layer holds no data");
  out.stamp_ns = info.stamp_ns;
  out.error_bound = layer.error_bound;
}

}  // namespace apgm::format
