#pragma once

#include <cstddef>
#include <memory>
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
std::vector<std::byte> to_bytes(const MapChanges& changes, const WriterOptions& options = {});

/// The map of a message, read whole and checked as any file.
/// @throws Error as Reader
Map map_from_bytes(std::span<const std::byte> bytes);
MapChanges changes_from_bytes(std::span<const std::byte> bytes);

}  // namespace apgm
