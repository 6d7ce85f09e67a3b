#pragma once

#include <memory>
#include <span>
#include <vector>

#include "apgm/format/stream.hpp"
#include "layer_block.hpp"
#include "stream_blocks.hpp"

namespace apgm::format {

/// A map header that arrived.
struct StreamHeader {
  MapHeader header;
  std::uint64_t hash = 0;            ///< payload hash of its block: the context of others
  std::uint64_t bytes = 0;           ///< of its block
  std::vector<std::uint64_t> names;  ///< hash of each type's name
};

// What blocks of a stream hold, checked on their own. All throw Error{kDamaged|kUnsupported}.

std::shared_ptr<const StreamHeader> read_stream_header(const Block& block);
LayerBlock read_stream_layer(const Block& block, const TypeTable& types);
std::vector<GoneRecord> read_gone(const Block& block, const TypeTable& types);
EndBody read_end(const Block& block);
/// A block that is none of these, and no Part: of a kind that may be passed over.
void check_other(const Block& block);

/// Content id as text; of zeros an empty one, and back.
std::string id_text(const std::array<std::byte, 16>& id);
/// @throws Error{kInvalidArgument} if the text is neither
std::array<std::byte, 16> id_from_text(const std::string& text);

/// Hash of a layer's place in the map, whatever number its type has.
std::uint64_t place_hash(PatchIndex patch, std::uint64_t name);

}  // namespace apgm::format
