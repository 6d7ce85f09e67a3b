#include "codec.hpp"

#include <algorithm>
#include <array>
#include <bit>

#include "codec_body.hpp"
#include "content_id.hpp"

namespace apgm::format {
namespace {

bool is_constant(const Layer& layer) {
  for (int c = 0; c < layer.channels(); ++c) {
    const auto plane = layer.plane(c);
    const auto first = std::bit_cast<std::uint32_t>(plane[0]);
    for (std::size_t i = 0; i < plane.size(); i += 256) {
      std::uint32_t differs = 0;
      const std::size_t end = std::min(plane.size(), i + 256);
      for (std::size_t k = i; k < end; ++k) differs |= std::bit_cast<std::uint32_t>(plane[k]) ^ first;
      if (differs != 0) return false;
    }
  }
  return true;
}

void decode_constant(Bytes body, Layer& out) {
  BodyReader reader(body);
  for (int c = 0; c < out.channels(); ++c) std::ranges::fill(out.plane(c), reader.take<float>());
  reader.expect_end();
}

}  // namespace

bool keeps_rules(const Layer& layer, const LayerType& type) {
  if (!type.is_evidence()) return is_canonical(layer, type);
  // Section 1 of docs/format.md.
  const float low = type.stores_omega() ? std::bit_cast<float>(0x3f7fffefu) : 0.0f;
  const float high = std::bit_cast<float>(0x3f800008u);
  std::array<const float*, kMaxChannels> planes{};
  const auto channels = static_cast<std::size_t>(layer.channels());
  for (std::size_t c = 0; c < channels; ++c) planes[c] = layer.plane(static_cast<int>(c)).data();
  return kernels().are_masses(planes.data(), channels, layer.cells(), low, high);
}

void encode(const Layer& layer, const LayerType& type, int level, Lossy lossy, StoredLayer& out) {
  out.bytes.clear();
  out.step = static_cast<std::uint8_t>(layer.step());
  out.content_hash = content_hash(layer);
  out.error_bound = std::max(layer.error_bound, type.is_evidence() ? error_bound(lossy) : 0.0f);
  if (is_constant(layer)) {
    out.encoding = static_cast<std::uint8_t>(Encoding::kConstant);
    for (int c = 0; c < layer.channels(); ++c) append_value(out.bytes, layer.plane(c)[0]);
    return;
  }
  try_palette(layer, level, out);
  try_masked(layer, type, level, lossy, out);
}

void decode(Encoding encoding, int step, Bytes body, const LayerType& type, Layer& out) {
  out.reshape(static_cast<int>(type.channels.size()), step);
  switch (encoding) {
    case Encoding::kConstant:
      decode_constant(body, out);
      break;
    case Encoding::kMasked32:
      decode_masked(body, 4, type, out);
      break;
    case Encoding::kPalette:
      decode_palette(body, out);
      break;
    case Encoding::kMasked16:
      decode_masked(body, 2, type, out);
      break;
    case Encoding::kMasked8:
      decode_masked(body, 1, type, out);
      break;
    default:
      fail_body("a layer has an unknown encoding");
  }
  if (!keeps_rules(out, type)) fail_body("a layer holds masses out of range");
}

}  // namespace apgm::format
