#pragma once

#include <span>

namespace apgm::converters {

/// Unpacks LZF data: literal runs, and references up to 8 KiB back.
/// @return false unless `in` gives exactly the bytes of `out`
bool unpack_lzf(std::span<const unsigned char> in, std::span<unsigned char> out);

}  // namespace apgm::converters
