#pragma once

#include <charconv>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "converters/scans/byte_stream.hpp"

namespace apgm::converters {

/// The lines of a stream, without their ends (LF or CR LF).
class LineReader {
 public:
  /// Longer lines are passed over.
  static constexpr std::size_t kMaxLineBytes = ByteStream::kMaxPeek - 1;

  explicit LineReader(ByteStream& bytes) : bytes_(bytes) {}

  enum class Got : std::uint8_t { kLine, kTooLong, kEnd };
  /// The next line; it stays valid until the next call.
  Got next(std::string_view& line);
  /// Passes over the line `next` gave last: the stream then stands behind it.
  void finish();
  /// Counts from 1; of the line `next` gave.
  std::uint64_t number() const { return number_; }
  /// "run.log:120"
  std::string place() const { return bytes_.path() + ":" + std::to_string(number_); }

 private:
  void skip_to_line_end();

  ByteStream& bytes_;
  std::size_t given_ = 0;  // bytes of the line that `next` gave last
  std::uint64_t number_ = 0;
};

/// Words of a line between blanks, commas too if `commas`; `words` is used again.
void split_words(std::string_view line, bool commas, std::vector<std::string_view>& words);

/// Without a plus in front, which std::from_chars does not take; "+-3" stays as it is, and is no number.
inline std::string_view number_text(std::string_view text) {
  return text.starts_with('+') && !text.starts_with("+-") ? text.substr(1) : text;
}

/// The whole text as a number, whatever the locale; "nan" and "inf" are numbers.
template <class Number>
std::optional<Number> number_in(std::string_view text) {
  text = number_text(text);
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return {};
  return value;
}

/// As number_in, but infinite where the number is too large for float32, and 0 where it is too small.
std::optional<float> float_in(std::string_view text);

/// Nanoseconds of a time in seconds; nullopt if not finite or beyond 4.6e9 s, so that the difference of any
/// two fits int64.
std::optional<std::int64_t> nanoseconds(double seconds);

}  // namespace apgm::converters
