#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace apgm::converters {

/// What an .npy file says of its array (NumPy's format 1.0, 2.0 and 3.0).
struct NpyHeader {
  std::string descr = "<f4";        ///< "<f4" or "<f8"
  std::vector<std::int64_t> shape;  ///< 1 to 8 sizes, each at least 1

  std::int64_t value_bytes() const { return descr == "<f8" ? 8 : 4; }
  /// Product of the shape; at most 2^40.
  std::int64_t values() const;
};

/// The bytes before the values: format 1.0, padded to 64.
std::string npy_head(const NpyHeader& header);

/// Reads an array from a stream of bytes; nothing is allocated for what has not been read.
/// @param read  fills the span and gives the number of bytes, fewer only at the end
/// @param max_bytes  of the values as float32
/// @param rounded  counts values that are no float32
/// @throws Error{kForeign} if it is no .npy file, {kUnsupported} on other values than little-endian floats,
/// or
///         columns before rows, {kDamaged} if the header or the size is wrong, {kLimit}
std::vector<float> read_npy(const std::function<std::size_t(std::span<std::byte>)>& read,
                            std::uint64_t max_bytes, NpyHeader& header, std::uint64_t& rounded);

}  // namespace apgm::converters
