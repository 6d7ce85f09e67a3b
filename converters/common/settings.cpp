#include "converters/common/settings.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

namespace apgm::converters {

SettingsReader::SettingsReader(const Converter& converter, const Settings& settings, Use use)
    : format_(converter.name()), settings_(settings) {
  std::string known;
  std::vector<std::string> keys;
  for (const SettingSpec& spec : converter.settings()) {
    if (use == Use::kReading ? !spec.for_reading : !spec.for_writing) continue;
    keys.push_back(spec.key);
    known += (known.empty() ? "" : ", ") + spec.key;
  }
  for (const auto& [key, value] : settings) {
    if (std::ranges::find(keys, key) != keys.end()) continue;
    throw Error(ErrorCode::kInvalidArgument, "format '" + format_ + "' has no setting '" + key + "' for " +
                                                 (use == Use::kReading ? "reading" : "writing"))
        .hint("its settings are " + known);
  }
}

void SettingsReader::refuse(const std::string& key, const std::string& why) const {
  const auto it = settings_.find(key);
  const std::string value = it == settings_.end() ? "" : "=" + it->second;
  throw Error(ErrorCode::kInvalidArgument,
              "setting '" + key + value + "' of format '" + format_ + "' " + why);
}

std::optional<std::string> SettingsReader::text(const std::string& key) const {
  const auto it = settings_.find(key);
  if (it == settings_.end()) return {};
  return it->second;
}

std::optional<double> SettingsReader::number(const std::string& key) const {
  const auto value = text(key);
  if (!value) return {};
  const auto number = parse_number(*value);
  if (!number) refuse(key, "is not a finite number");
  return number;
}

std::optional<double> SettingsReader::number(const std::string& key, double low, double high) const {
  const auto value = number(key);
  if (value && (*value < low || *value > high)) {
    refuse(key, "does not lie in " + format_number(low) + ".." + format_number(high));
  }
  return value;
}

std::optional<Point> SettingsReader::point(const std::string& key) const {
  const auto value = text(key);
  if (!value) return {};
  const std::size_t comma = value->find(',');
  if (comma != std::string::npos) {
    const auto x = parse_number(std::string_view(*value).substr(0, comma));
    const auto y = parse_number(std::string_view(*value).substr(comma + 1));
    if (x && y) return Point{*x, *y};
  }
  refuse(key, "is not X,Y in metres");
}

std::optional<std::string> SettingsReader::choice(const std::string& key,
                                                  std::span<const std::string_view> names) const {
  const auto value = text(key);
  if (!value || std::ranges::find(names, *value) != names.end()) return value;
  std::string list;
  for (const auto name : names) list += (list.empty() ? "" : ", ") + std::string(name);
  refuse(key, "is not one of " + list);
}

std::optional<bool> SettingsReader::flag(const std::string& key) const {
  static constexpr std::array<std::string_view, 4> kNames{"0", "1", "false", "true"};
  const auto value = choice(key, kNames);
  if (!value) return {};
  return *value == "1" || *value == "true";
}

std::vector<SettingSpec> frame_settings() {
  return {{"datum", "X,Y in metres: lower-left corner of patch (0, 0)", ""},
          {"edge_m", "side of a patch in metres, 0.001 to 10000", "cell size x 2^r nearest 12.8"},
          {"frame_id", "name of the coordinate frame", "map"},
          {"epsg", "EPSG code of the coordinates, 1 to 999999", ""}};
}

void read_names(const SettingsReader& settings, Frame& frame) {
  if (const auto id = settings.text("frame_id")) frame.frame_id = *id;
  if (const auto epsg = settings.number("epsg", 1, 999'999)) {
    if (*epsg != std::floor(*epsg)) settings.refuse("epsg", "is not a whole number");
    frame.epsg = static_cast<std::int32_t>(*epsg);
  }
}

namespace {

/// Bytes of the UTF-8 sequence `text` starts with; 0 if that is none.
std::size_t utf8_bytes(std::string_view text) {
  const auto at = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned first = at(0);
  const std::size_t bytes = first < 0x80   ? 1
                            : first < 0xc2 ? 0
                            : first < 0xe0 ? 2
                            : first < 0xf0 ? 3
                            : first < 0xf5 ? 4
                                           : 0;
  if (bytes > text.size()) return 0;
  for (std::size_t i = 1; i < bytes; ++i) {
    if ((at(i) & 0xc0u) != 0x80) return 0;
  }
  if (bytes < 2) return bytes;
  const unsigned second = at(1);
  const bool bad = (first == 0xc2 && second < 0xa0) ||  // a control character
                   (first == 0xe0 && second < 0xa0) || (first == 0xed && second > 0x9f) ||
                   (first == 0xf0 && second < 0x90) || (first == 0xf4 && second > 0x8f);
  return bad ? 0 : bytes;
}

}  // namespace

std::string printable(std::string_view text) {
  constexpr std::size_t kMostBytes = 80;
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string out;
  std::size_t at = 0;
  while (at < text.size() && at < kMostBytes) {
    const auto byte = static_cast<unsigned char>(text[at]);
    const std::size_t bytes = byte < 0x20 || byte == 0x7f ? 0 : utf8_bytes(text.substr(at));
    if (bytes == 0) {
      out += {'\\', 'x', kDigits[byte >> 4], kDigits[byte & 15u]};
    } else {
      out += text.substr(at, bytes);
    }
    at += std::max<std::size_t>(bytes, 1);
  }
  return at < text.size() ? out + "..." : out;
}

std::optional<double> parse_number(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return {};
  return value;
}

std::string format_number(double value) {
  std::array<char, 32> buffer;
  const auto [end, error] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return {buffer.data(), end};
}

}  // namespace apgm::converters
