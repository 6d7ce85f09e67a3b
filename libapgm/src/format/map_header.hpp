#pragma once

#include "apgm/core/source.hpp"
#include "block.hpp"

namespace apgm::format {

inline constexpr std::size_t kMaxMetadata = 1024;
inline constexpr std::size_t kMaxHistory = 1024;
inline constexpr std::size_t kMaxInputs = 65'536;  // of a history entry
inline constexpr std::uint64_t kMaxHeaderBytes = std::uint64_t{16} << 20;

/// Appends the MapHeader block. @throws Error{kLimit|kInvalidArgument} on a header the format cannot hold
BlockHeader append_map_header(std::vector<std::byte>& out, const MapHeader& header, std::uint64_t commit = 1);

/// @throws Error{kDamaged}
MapHeader read_map_header(Bytes block);
MapHeader read_map_header(const Block& block);

}  // namespace apgm::format
