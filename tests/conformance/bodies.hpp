#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "apgm/core/layer_type.hpp"
#include "parts.hpp"

namespace apgm::test {

/// Bits of the values of each channel, cell by cell.
using Planes = std::vector<std::vector<std::uint32_t>>;

/// One zstd frame of level 3.
std::string zstd_frame(const std::string& content);
/// One with a checksum of its own, or without its content size.
std::string zstd_frame_with_checksum(const std::string& content);
std::string zstd_frame_without_size(const std::string& content);
/// A frame zstd skips.
std::string skippable_frame();

std::string u32(std::uint32_t value);
std::string floats(const std::vector<std::uint32_t>& bits);
/// Byte planes of `words`, from byte `high` down to byte `low`.
std::string byte_planes(const std::vector<std::uint32_t>& words, int high, int low);

/// Pieces of a masked body, each of which can be made wrong before they are joined.
struct Masked {
  std::vector<std::uint32_t> counts;
  std::uint32_t raw_planes = 0;
  std::string masks;
  std::vector<std::uint32_t> values;
  int width = 4;
  std::string content() const;
  std::string body() const { return body(zstd_frame(content())); }
  std::string body(const std::string& frame) const;
};
/// Values with width < 4 are the whole numbers q themselves.
Masked masked(const LayerType& type, const Planes& planes, std::uint32_t raw_planes = 0);

std::string palette_content(const Planes& tuples, const std::vector<std::uint32_t>& numbers);
/// `tuples` tuple by tuple.
std::string palette_body(const Planes& tuples, const std::vector<std::uint32_t>& numbers);

std::uint64_t content_hash(const Planes& planes, int step);

/// A layer whose entry and content hash fit the cells.
StoredPart stored(PatchIndex patch, TypeId type, int step, std::uint8_t encoding, const Planes& cells,
                  std::string body);
StoredPart stored_constant(PatchIndex patch, TypeId type, int step, const std::vector<std::uint32_t>& tuple);
StoredPart stored_masked(PatchIndex patch, TypeId type, int step, const LayerType& of, const Planes& cells);

/// Bits of a float32.
std::uint32_t bits(float value);

}  // namespace apgm::test
