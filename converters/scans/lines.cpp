#include "converters/scans/lines.hpp"

#include <algorithm>
#include <cmath>

namespace apgm::converters {

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

std::optional<std::int64_t> nanoseconds(double seconds) {
  constexpr double kMostSeconds = 9e9;
  if (!(std::fabs(seconds) <= kMostSeconds)) return {};
  return std::llround(seconds * 1e9);
}

}  // namespace apgm::converters
