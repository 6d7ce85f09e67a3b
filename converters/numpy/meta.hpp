#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "apgm/core/source.hpp"

namespace apgm::converters {

/// One array: all channels of a layer's cells of one step, shape (channels, rows, columns), row 0 the
/// southernmost, column 0 the westernmost.
struct ArrayMeta {
  std::string array;  ///< name of its .npy
  LayerType type;
  int step = 0;
  std::int64_t cell_x = 0, cell_y = 0;  ///< of element (0, 0), in cells from the datum; |c| <= 2^43
};

/// What stands beside the arrays, as JSON (docs/converters.md).
struct NumpyMeta {
  Frame frame;
  std::int64_t stamp_ns = 0;
  std::vector<ArrayMeta> arrays;
};

inline constexpr std::uint64_t kMostMetaBytes = std::uint64_t{16} << 20;

std::string to_json(const NumpyMeta& meta);
/// @throws Error{kDamaged} that names the key, {kForeign} on other JSON, {kUnsupported} on another version,
///         {kLimit} on more than 4096 arrays
NumpyMeta from_json(const std::string& text);

}  // namespace apgm::converters
