#include "bodies.hpp"

#include <bit>
#include <memory>

#include <xxhash.h>
#include <zstd.h>

namespace apgm::test {
namespace {

using Context = std::unique_ptr<ZSTD_CCtx, decltype(&ZSTD_freeCCtx)>;

std::string zstd_frame_with(ZSTD_cParameter parameter, int value, const std::string& content) {
  const Context context(ZSTD_createCCtx(), &ZSTD_freeCCtx);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, 3);
  ZSTD_CCtx_setParameter(context.get(), parameter, value);
  std::string frame(ZSTD_compressBound(content.size()), '\0');
  frame.resize(ZSTD_compress2(context.get(), frame.data(), frame.size(), content.data(), content.size()));
  return frame;
}

std::string mask_of(const std::vector<std::uint32_t>& plane, std::uint32_t background) {
  std::string mask((plane.size() + 7) / 8, '\0');
  for (std::size_t i = 0; i < plane.size(); ++i) {
    if (plane[i] == background) continue;
    mask[i / 8] = static_cast<char>(static_cast<unsigned char>(mask[i / 8]) | 1u << i % 8);
  }
  return mask;
}

}  // namespace

std::uint32_t bits(float value) { return std::bit_cast<std::uint32_t>(value); }

std::string zstd_frame(const std::string& content) {
  return zstd_frame_with(ZSTD_c_checksumFlag, 0, content);
}

std::string zstd_frame_with_checksum(const std::string& content) {
  return zstd_frame_with(ZSTD_c_checksumFlag, 1, content);
}

std::string zstd_frame_without_size(const std::string& content) {
  return zstd_frame_with(ZSTD_c_contentSizeFlag, 0, content);
}

std::string skippable_frame() { return u32(0x184D2A50) + u32(4) + "skip"; }

std::string u32(std::uint32_t value) { return {reinterpret_cast<const char*>(&value), sizeof(value)}; }

std::string floats(const std::vector<std::uint32_t>& values) {
  std::string text;
  for (const std::uint32_t value : values) text += u32(value);
  return text;
}

std::string byte_planes(const std::vector<std::uint32_t>& words, int high, int low) {
  std::string text;
  for (int k = high; k >= low; --k) {
    for (const std::uint32_t word : words) text += static_cast<char>(word >> (8 * k) & 0xff);
  }
  return text;
}

std::string Masked::content() const {
  return masks + byte_planes(values, width - 1, static_cast<int>(raw_planes));
}

std::string Masked::body(const std::string& frame) const {
  return floats(counts) + u32(raw_planes) + u32(static_cast<std::uint32_t>(frame.size())) + frame +
         byte_planes(values, static_cast<int>(raw_planes) - 1, 0);
}

Masked masked(const LayerType& type, const Planes& planes, std::uint32_t raw_planes) {
  Masked m;
  m.raw_planes = raw_planes;
  for (std::size_t c = 0; c < planes.size(); ++c) {
    // The library's NaN is the quiet one of the page.
    const std::uint32_t background = bits(type.background(static_cast<int>(c)));
    m.masks += mask_of(planes[c], background);
    std::uint32_t count = 0;
    for (const std::uint32_t value : planes[c]) {
      if (value == background) continue;
      m.values.push_back(value);
      ++count;
    }
    m.counts.push_back(count);
  }
  return m;
}

std::string palette_content(const Planes& tuples, const std::vector<std::uint32_t>& numbers) {
  std::vector<std::uint32_t> values;
  for (const auto& tuple : tuples) values.insert(values.end(), tuple.begin(), tuple.end());
  return byte_planes(values, 3, 0) + byte_planes(numbers, tuples.size() > 256 ? 1 : 0, 0);
}

std::string palette_body(const Planes& tuples, const std::vector<std::uint32_t>& numbers) {
  return u32(static_cast<std::uint32_t>(tuples.size())) + zstd_frame(palette_content(tuples, numbers));
}

std::uint64_t content_hash(const Planes& planes, int step) {
  std::string bytes;
  for (const auto& plane : planes) bytes += floats(plane);
  return XXH3_64bits_withSeed(bytes.data(), bytes.size(),
                              static_cast<std::uint64_t>(step) + 256 * planes.size());
}

StoredPart stored(PatchIndex patch, TypeId type, int step, std::uint8_t encoding, const Planes& cells,
                  std::string body) {
  StoredPart part;
  part.entry.ix = patch.x;
  part.entry.iy = patch.y;
  part.entry.type = type;
  part.entry.step = static_cast<std::uint8_t>(step);
  part.entry.encoding = encoding;
  part.entry.content_hash = content_hash(cells, step);
  part.body = std::move(body);
  return part;
}

StoredPart stored_constant(PatchIndex patch, TypeId type, int step, const std::vector<std::uint32_t>& tuple) {
  Planes cells;
  for (const std::uint32_t value : tuple) cells.emplace_back(std::size_t{1} << (2 * step), value);
  return stored(patch, type, step, 0, cells, floats(tuple));
}

StoredPart stored_masked(PatchIndex patch, TypeId type, int step, const LayerType& of, const Planes& cells) {
  return stored(patch, type, step, 1, cells, masked(of, cells).body());
}

}  // namespace apgm::test
