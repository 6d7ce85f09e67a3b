#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "apgm/layouts/description.hpp"

namespace apgm::converters {

/// First bytes of a fixed-grid file.
inline constexpr std::string_view kFixedGridMagic = "APGMFIXG";

/// A layout as the bytes of a file (schema/fixed_grid.fbs): each cell's channels as those of a layer, in
/// tiles of 128 x 128 cells or in whole sub-maps, with the encodings of .apgm files, lossless. The same
/// layout gives the same bytes.
std::vector<std::byte> encode_layout(const Layout& layout, int level = 3);

/// The layout of such bytes.
/// @param max_bytes  most memory its cells may take; 0: 4 GiB
/// @throws Error{kForeign|kDamaged|kUnsupported|kLimit}
std::unique_ptr<Layout> decode_layout(std::span<const std::byte> bytes, std::uint64_t max_bytes = 0);

}  // namespace apgm::converters
