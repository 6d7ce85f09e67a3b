#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>

namespace apgm::converters {

/// A pixel in 16 bits a channel, whatever the picture stores.
struct Pixel {
  std::uint16_t red = 0;
  std::uint16_t green = 0;
  std::uint16_t blue = 0;
  std::uint16_t alpha = 65535;  ///< 65535: opaque
};

struct PictureInfo {
  std::int64_t width = 0;
  std::int64_t height = 0;
  bool has_alpha = false;
  /// Memory that decoding takes beside the file: a row, or all of an interlaced PNG.
  std::uint64_t decoding_bytes = 0;
};

/// Where a picture goes: its size once, then its rows from the top.
struct PictureSink {
  /// Before memory is taken for pixels. @param file_bytes  of the file, which stays in memory
  std::function<void(const PictureInfo&, std::uint64_t file_bytes)> begin;
  std::function<void(std::span<const Pixel>)> row;
};

/// Most pixels of a picture that is read or written: 2^31.
inline constexpr std::int64_t kMaxPixels = std::int64_t{1} << 31;
/// A row is held in memory whole: a tiny file must not ask for a huge one. libpng's own default is a million.
inline constexpr std::int64_t kMaxSide = std::int64_t{1} << 20;
/// @throws Error{kLimit} above kMaxPixels or kMaxSide
void check_pixels(std::int64_t width, std::int64_t height);

/// PGM (P2, P5; 1 to 65535 grey values) and PNG (any). The size is checked against the bytes before `begin`.
/// @throws Error{kUnreadable|kForeign|kUnsupported|kDamaged|kLimit}
/// @param max_memory_bytes  bound of the file, which is held as a whole, and of what decoding takes; 0: none
void read_picture(const std::string& path, const PictureSink& sink, std::uint64_t max_memory_bytes = 0);

void read_pnm(std::string_view bytes, const PictureSink& sink);
void read_png(std::string_view bytes, const PictureSink& sink);

}  // namespace apgm::converters
