#pragma once

#include <vector>

#include "apgm/core/source.hpp"
#include "apgm/format/writer.hpp"
#include "block.hpp"

namespace apgm::format {

/// What a Layer block says of its layer beside the body.
struct LayerBlock {
  LayerInfo info;  ///< without stored_bytes and locator
  float error_bound = 0;
};

/// Of the values of a layer.
std::uint64_t value_bytes(const LayerType& type, int step);
/// No encoding of a layer is larger than its values, masks and frame overhead: what a block may take in
/// memory.
std::uint64_t most_stored_bytes(const LayerType& type, int step);

/// @throws Error{kInvalidArgument} unless a level of zstd lies in 1..19
void check_level(int level);

/// Makes a parcel of cells ready to be stored: canonicalises, rounds, drops the vacuous, encodes.
/// Thread-safe.
/// @throws Error{kInvalidArgument} on masses out of range
void pack_layer(Parcel& parcel, const LayerType& type, int level, Lossy lossy);
/// What a thread takes for that beside the layer, of `layer_bytes` of values (WorkingMemory).
std::uint64_t pack_memory(std::uint64_t layer_bytes, int level);

/// Appends the block of a packed layer. Returns its header.
BlockHeader append_layer(std::vector<std::byte>& out, const Parcel& parcel, std::uint64_t commit = 1,
                         std::uint64_t context = 0);

/// The FlatBuffer of a Layer block, checked on its own: form, key, error bound.
/// @throws Error{kDamaged}
LayerBlock read_layer_block(const Block& block);

/// Decodes the body of a Layer block.
/// @throws Error{kDamaged} if it holds other cells than those of the content hash, or no data
void decode_layer(const LayerBlock& layer, Bytes body, const LayerType& type, Layer& out);

}  // namespace apgm::format
