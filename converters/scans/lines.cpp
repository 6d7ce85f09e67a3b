#include "converters/scans/lines.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace apgm::converters {
namespace {

/// Fewer places before the point than a number has that is too large for float32.
constexpr std::size_t kFloatPlaces = 30;

}  // namespace

LineReader::Got LineReader::next(std::string_view& line) {
  finish();
  ++number_;
  std::size_t searched = 0;
  std::string_view text = bytes_.peek();
  if (text.empty()) return Got::kEnd;
  std::size_t end = text.find('\n');
  while (end == std::string_view::npos) {
    if (text.size() > kMaxLineBytes) {
      skip_to_line_end();
      return Got::kTooLong;
    }
    searched = text.size();
    text = bytes_.peek(std::min(2 * searched, ByteStream::kMaxPeek));
    end = text.find('\n', searched);
    if (end == std::string_view::npos && text.size() == searched) break;  // the last line, without an end
  }
  line = text.substr(0, end);
  given_ = end == std::string_view::npos ? text.size() : end + 1;
  if (line.ends_with('\r')) line.remove_suffix(1);
  return Got::kLine;
}

void LineReader::finish() {
  bytes_.skip(given_);
  given_ = 0;
}

void LineReader::skip_to_line_end() {
  for (std::string_view text = bytes_.peek(); !text.empty(); text = bytes_.peek()) {
    const std::size_t end = text.find('\n');
    bytes_.skip(end == std::string_view::npos ? text.size() : end + 1);
    if (end != std::string_view::npos) return;
  }
}

void split_words(std::string_view line, bool commas, std::vector<std::string_view>& words) {
  const auto divides = [commas](char c) { return c == ' ' || c == '\t' || (commas && c == ','); };
  words.clear();
  for (auto at = line.begin(); at != line.end();) {
    const auto from = std::find_if_not(at, line.end(), divides);
    at = std::find_if(from, line.end(), divides);
    if (from != at) words.emplace_back(from, at);
  }
}

std::optional<float> float_in(std::string_view text) {
  const std::string_view digits = number_text(text);
  const char* const stop = digits.data() + digits.size();
  float value = 0;
  const auto [end, error] = std::from_chars(digits.data(), stop, value);
  if (end != stop || error == std::errc::invalid_argument) return {};
  if (error != std::errc::result_out_of_range) return value;
  // The sign of the exponent tells too large from too small; without one the places before the point do.
  const std::size_t exponent = digits.find_first_of("eE");
  const bool small = exponent != digits.npos ? digits.substr(exponent + 1).starts_with('-')
                                             : digits.substr(0, digits.find('.')).size() <= kFloatPlaces;
  const float size = small ? 0.0f : std::numeric_limits<float>::infinity();
  return digits.starts_with('-') ? -size : size;
}

std::optional<std::int64_t> nanoseconds(double seconds) {
  constexpr double kMostSeconds = 4.6e9;
  if (!(std::fabs(seconds) <= kMostSeconds)) return {};
  return std::llround(seconds * 1e9);
}

}  // namespace apgm::converters
