#pragma once

#include <cstdint>

#include "apgm/core/layer.hpp"
#include "apgm/core/source.hpp"
#include "apgm/format/writer.hpp"
#include "block.hpp"

namespace apgm::format {

/// How a layer's body is laid out (docs/format.md, "Encodings").
enum class Encoding : std::uint8_t {
  kConstant = 0,  ///< one tuple for all cells
  kMasked32 =
      1,         ///< masks of cells with data; their values as byte planes, the low ones perhaps uncompressed
  kPalette = 2,  ///< distinct tuples and an index plane
  kMasked16 = 3,  ///< as kMasked32, values are q / 65535
  kMasked8 = 4,   ///< as kMasked32, values are q / 255
};
inline constexpr std::uint8_t kLastEncoding = 4;

/// Encodes canonical cells: the smallest of the encodings that apply, found by trying. Thread-safe.
/// With `lossy`, masses must have been through `quantise`.
void encode(const Layer& layer, const LayerType& type, int level, Lossy lossy, StoredLayer& out);

/// is_canonical(layer, type), in fewer instructions.
bool keeps_rules(const Layer& layer, const LayerType& type);

/// Takes every mass to a multiple of 1/255 or 1/65535, the sum kept (largest remainders); real channels stay.
void quantise(Layer& layer, const LayerType& type, Lossy lossy);
/// Greatest error of a mass by `quantise`.
float error_bound(Lossy lossy);

/// @throws Error{kDamaged} if the body does not fit its encoding, or the cells are not canonical masses
void decode(Encoding encoding, int step, Bytes body, const LayerType& type, Layer& out);

/// zstd frame of `content` at the end of `out`. Single-threaded, content size present. Returns the frame's
/// size.
std::size_t append_frame(std::vector<std::byte>& out, Bytes content, int level);
/// The same into `room` of at least `frame_bound(content.size())` bytes. Returns the frame's size.
std::size_t write_frame(std::span<std::byte> room, Bytes content, int level);
std::size_t frame_bound(std::size_t content_bytes);
/// Most memory that zstd keeps on a thread for frames of up to so many bytes.
std::uint64_t frame_memory(std::uint64_t content_bytes, int level);
/// Decodes one frame that must fill `frame` exactly and hold exactly `out.size()` bytes.
/// @throws Error{kDamaged}
void read_frame(Bytes frame, std::span<std::byte> out);

}  // namespace apgm::format
