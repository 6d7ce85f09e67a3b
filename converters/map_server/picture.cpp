#include "converters/map_server/picture.hpp"

#include "apgm/core/error.hpp"
#include "converters/common/file.hpp"

namespace apgm::converters {

void check_pixels(std::int64_t width, std::int64_t height) {
  if (width <= kMaxSide && height <= kMaxSide && width <= kMaxPixels / height) return;
  throw Error(ErrorCode::kLimit, "the picture has " + std::to_string(width) + " x " + std::to_string(height) +
                                     " pixels; the limits are 2^20 a side and 2^31 in all")
      .hint("crop it");
}

void read_picture(const std::string& path, const PictureSink& sink, std::uint64_t max_memory_bytes) {
  const std::string bytes = read_file_within(path, max_memory_bytes);
  const std::string_view head = std::string_view(bytes).substr(0, 8);
  naming(path, [&] {
    if (bytes.empty()) throw Error(ErrorCode::kDamaged, "the picture is empty");
    if (head.starts_with("P2") || head.starts_with("P5")) return read_pnm(bytes, sink);
    if (head == "\x89PNG\r\n\x1a\n") return read_png(bytes, sink);
    const bool other_pnm = head.size() > 2 && head[0] == 'P' && head[1] >= '1' && head[1] <= '7';
    throw Error(other_pnm || head.starts_with("BM") ? ErrorCode::kUnsupported : ErrorCode::kForeign,
                "the picture is neither PGM (P2, P5) nor PNG")
        .hint("convert it to PNG");
  });
}

}  // namespace apgm::converters
