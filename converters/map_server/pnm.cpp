#include <charconv>
#include <vector>

#include "apgm/core/error.hpp"
#include "converters/map_server/picture.hpp"

namespace apgm::converters {
namespace {

[[noreturn]] void damaged(const std::string& what, std::size_t offset) {
  throw Error(ErrorCode::kDamaged, "the PGM picture " + what + " at byte " + std::to_string(offset))
      .at("", offset);
}

bool is_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

/// Numbers in text, with '#' comments to the end of the line between them.
class Numbers {
 public:
  Numbers(std::string_view bytes, std::size_t at) : bytes_(bytes), at_(at) {}

  std::int64_t next(std::int64_t low, std::int64_t high, const char* what) {
    skip();
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(bytes_.data() + at_, bytes_.data() + bytes_.size(), value);
    if (at_ == bytes_.size()) damaged("is cut off", at_);
    if (error != std::errc() || value < low || value > high) {
      damaged(std::string("has ") + what + " that is no number in " + std::to_string(low) + ".." +
                  std::to_string(high),
              at_);
    }
    at_ = static_cast<std::size_t>(end - bytes_.data());
    if (at_ < bytes_.size() && !is_space(bytes_[at_]) && bytes_[at_] != '#') {
      damaged(std::string("has ") + what + " that is no number", at_);
    }
    return value;
  }
  void skip() {
    while (at_ < bytes_.size() && (is_space(bytes_[at_]) || bytes_[at_] == '#')) {
      if (bytes_[at_] != '#') {
        ++at_;
        continue;
      }
      const std::size_t end = bytes_.find('\n', at_);
      at_ = end == std::string_view::npos ? bytes_.size() : end + 1;
    }
  }
  std::size_t at() const { return at_; }

 private:
  std::string_view bytes_;
  std::size_t at_;
};

Pixel grey(std::int64_t value, std::int64_t max) {
  const auto v = static_cast<std::uint16_t>((value * 65535 + max / 2) / max);
  return {v, v, v, 65535};
}

}  // namespace

void read_pnm(std::string_view bytes, const PictureSink& sink) {
  constexpr std::int64_t kMostDigits = 0x7fffffff;
  const bool text = bytes[1] == '2';
  Numbers numbers(bytes, 2);
  PictureInfo info;
  info.width = numbers.next(1, kMostDigits, "a width");
  info.height = numbers.next(1, kMostDigits, "a height");
  const std::int64_t max = numbers.next(1, 65535, "a greatest grey value");
  check_pixels(info.width, info.height);

  const auto pixels = static_cast<std::uint64_t>(info.width * info.height);
  const std::uint64_t sample_bytes = max > 255 ? 2 : 1;
  std::size_t at = numbers.at() + (text ? 0 : 1);  // one white-space character ends a binary header
  const std::uint64_t left = at <= bytes.size() ? bytes.size() - at : 0;
  if (text ? left < 2 * pixels : left < pixels * sample_bytes) damaged("is cut off", bytes.size());
  if (!text && left > pixels * sample_bytes)
    damaged("has bytes after its last pixel", at + pixels * sample_bytes);

  info.decoding_bytes = static_cast<std::uint64_t>(info.width) * sizeof(Pixel);
  sink.begin(info, bytes.size());
  std::vector<Pixel> row(static_cast<std::size_t>(info.width));
  for (std::int64_t y = 0; y < info.height; ++y) {
    for (Pixel& pixel : row) {
      std::int64_t value = 0;
      if (text) {
        value = numbers.next(0, max, "a pixel");
      } else {
        for (std::uint64_t i = 0; i < sample_bytes; ++i)
          value = value << 8 | static_cast<unsigned char>(bytes[at++]);
        if (value > max) damaged("has a pixel above its greatest grey value", at - sample_bytes);
      }
      pixel = grey(value, max);
    }
    sink.row(row);
  }
  if (!text) return;
  numbers.skip();
  if (numbers.at() != bytes.size()) damaged("has bytes after its last pixel", numbers.at());
}

}  // namespace apgm::converters
