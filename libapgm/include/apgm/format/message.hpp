#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "apgm/core/map_changes.hpp"
#include "apgm/core/source.hpp"
#include "apgm/format/writer.hpp"

namespace apgm {

/// A whole map as the bytes of an .apgm file, for a wire or a queue: the very bytes a Writer puts in a file.
/// @param options  `output` is not used
std::vector<std::byte> to_bytes(const PatchSource& map, const WriterOptions& options = {});
/// Changes as such bytes; what is gone goes along in the metadata (docs/format.md, "Well-known metadata").
/// @throws Error{kInvalidArgument} if what is gone is not in order, of no type of the map, or also changed;
///         {kLimit} if it does not fit a header (some 500 000 layers)
std::vector<std::byte> to_bytes(const MapChanges& changes, const WriterOptions& options = {});

/// The map of a message, read whole and checked as any file.
/// @param max_bytes  most memory its values may take, since a small message may hold a large map
/// @throws Error as Reader, {kLimit} beyond max_bytes
Map map_from_bytes(std::span<const std::byte> bytes, std::uint64_t max_bytes = std::uint64_t{1} << 30);
/// Changes; of the bytes of a map, that all of it changed and nothing is gone.
MapChanges changes_from_bytes(std::span<const std::byte> bytes,
                              std::uint64_t max_bytes = std::uint64_t{1} << 30);

}  // namespace apgm
