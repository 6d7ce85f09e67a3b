#include "tools/common/parse.hpp"

#include <fmt/format.h>

#include <array>
#include <cctype>
#include <charconv>
#include <chrono>
#include <cmath>
#include <limits>

#include "tools/common/exit_code.hpp"
#include "tools/common/json.hpp"
#include "tools/common/suggest.hpp"

namespace apgm::tools {
namespace {

constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;

Error refused(const std::string& option, std::string_view text, const std::string& wanted,
              const std::string& hint = {}) {
  return usage_error(fmt::format("{} takes {}, not '{}'", option, wanted, text), hint);
}

std::string_view trimmed(std::string_view text) {
  const std::size_t from = text.find_first_not_of(' ');
  if (from == std::string_view::npos) return {};
  return text.substr(from, text.find_last_not_of(' ') - from + 1);
}

template <typename Number>
bool read(std::string_view text, Number& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && !text.empty();
}

bool read_finite(std::string_view text, double& value) { return read(text, value) && std::isfinite(value); }

std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (std::size_t from = 0;;) {
    const std::size_t end = text.find(separator, from);
    parts.push_back(text.substr(from, end == std::string_view::npos ? end : end - from));
    if (end == std::string_view::npos) return parts;
    from = end + 1;
  }
}

/// Reads "2026-01-31T12:00:00Z", false if it is not of this form or no such moment exists.
bool read_utc(std::string_view text, std::int64_t& seconds) {
  if (text.size() != 20 || text[4] != '-' || text[7] != '-' || text[10] != 'T' || text[13] != ':' ||
      text[16] != ':' || text[19] != 'Z') {
    return false;
  }
  int year = 0;
  unsigned month = 0, day = 0, hour = 0, minute = 0, second = 0;
  if (!read(text.substr(0, 4), year) || !read(text.substr(5, 2), month) || !read(text.substr(8, 2), day) ||
      !read(text.substr(11, 2), hour) || !read(text.substr(14, 2), minute) ||
      !read(text.substr(17, 2), second)) {
    return false;
  }
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(month),
                                         std::chrono::day(day)};
  if (!date.ok() || year < 1700 || year > 2200 || hour > 23 || minute > 59 || second > 59) return false;
  seconds = std::int64_t{std::chrono::sys_days(date).time_since_epoch().count()} * 86'400 + hour * 3600 +
            minute * 60 + second;
  return true;
}

}  // namespace

double parse_real(const std::string& option, std::string_view text) {
  double value = 0;
  if (!read_finite(text, value)) throw refused(option, text, "a number");
  return value;
}

double parse_positive(const std::string& option, std::string_view text) {
  double value = 0;
  if (!read_finite(text, value) || value <= 0) throw refused(option, text, "a number above 0");
  return value;
}

double parse_real(const std::string& option, std::string_view text, double min, double max) {
  double value = 0;
  if (!read_finite(text, value) || value < min || value > max) {
    throw refused(option, text, fmt::format("a number from {} to {}", number_text(min), number_text(max)));
  }
  return value;
}

std::int64_t parse_integer(const std::string& option, std::string_view text, std::int64_t min,
                           std::int64_t max, const std::string& hint) {
  std::int64_t value = 0;
  if (!read(text, value) || value < min || value > max) {
    throw refused(option, text, fmt::format("a whole number from {} to {}", min, max), hint);
  }
  return value;
}

std::uint64_t parse_size(const std::string& option, std::string_view text) {
  struct Unit {
    std::string_view name;
    double bytes;
  };
  static constexpr std::array<Unit, 13> kUnits{{{"k", 1024.},
                                                {"m", 1048576.},
                                                {"g", 1073741824.},
                                                {"t", 1099511627776.},
                                                {"kib", 1024.},
                                                {"mib", 1048576.},
                                                {"gib", 1073741824.},
                                                {"tib", 1099511627776.},
                                                {"kb", 1e3},
                                                {"mb", 1e6},
                                                {"gb", 1e9},
                                                {"tb", 1e12},
                                                {"b", 1.}}};
  constexpr const char* kWanted = "a size such as 512M, 1.5GB or a number of bytes";
  constexpr const char* kHint =
      "units: B; K, M, G, T or KiB, MiB, GiB, TiB (powers of 1024); KB, MB, GB, TB (powers of 1000)";
  const std::size_t digits = std::min(text.find_first_not_of("0123456789."), text.size());
  std::string_view unit = text.substr(digits);
  while (unit.starts_with(' ')) unit.remove_prefix(1);
  std::string lower;
  for (const char c : unit) lower += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  double factor = unit.empty() ? 1 : 0;
  for (const Unit& known : kUnits) {
    if (lower == known.name) factor = known.bytes;
  }
  double number = 0;
  if (factor == 0 || !read_finite(text.substr(0, digits), number)) {
    throw refused(option, text, kWanted, kHint);
  }
  const double bytes = number * factor;
  if (bytes < 1 || bytes > 9e18) throw refused(option, text, kWanted, kHint);
  return static_cast<std::uint64_t>(bytes);
}

Box parse_box(const std::string& option, std::string_view text) {
  constexpr const char* kHint =
      "a box is XMIN,YMIN,XMAX,YMAX in metres with XMIN < XMAX and YMIN < YMAX, such as -10,0,90.5,60";
  const std::vector<std::string_view> parts = split(text, ',');
  if (parts.size() != 4) {
    throw usage_error(fmt::format("{} takes 4 numbers, not {}: '{}'", option, parts.size(), text), kHint);
  }
  std::array<double, 4> v{};
  for (std::size_t i = 0; i < 4; ++i) {
    if (!read_finite(trimmed(parts[i]), v[i])) {
      throw usage_error(fmt::format("{}: '{}' is not a number", option, trimmed(parts[i])), kHint);
    }
    if (std::fabs(v[i]) > kMaxCoordinate_m) {
      throw usage_error(fmt::format("{}: {} lies beyond 4e9 m", option, trimmed(parts[i])),
                        "coordinates are metres of the map's CRS");
    }
  }
  for (const std::size_t axis : {std::size_t{0}, std::size_t{1}}) {
    if (v[axis] < v[axis + 2]) continue;
    const char* fault = v[axis] == v[axis + 2] ? "empty" : "inverted";
    throw usage_error(fmt::format("{}: the box is {} in {}: {} to {}", option, fault, axis == 0 ? 'x' : 'y',
                                  number_text(v[axis]), number_text(v[axis + 2])),
                      kHint);
  }
  return {{v[0], v[1]}, {v[2], v[3]}};
}

std::int64_t parse_time(const std::string& option, std::string_view text) {
  if (text == "now") {
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    return std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
  }
  constexpr std::int64_t kMaxSeconds = std::numeric_limits<std::int64_t>::max() / kNanosecondsPerSecond;
  std::int64_t seconds = 0;
  const bool known = text.starts_with('@') ? read(text.substr(1), seconds) : read_utc(text, seconds);
  if (!known || seconds > kMaxSeconds || seconds < -kMaxSeconds) {
    throw refused(option, text, "a time such as 2026-01-31T12:00:00Z, @SECONDS since 1970, or now",
                  "a date is in UTC, in whole seconds and ends with Z; years from 1700 to 2200");
  }
  return seconds * kNanosecondsPerSecond;
}

std::int64_t parse_stamp(const std::string& option, std::string_view text) {
  const std::int64_t stamp_ns = parse_time(option, text);
  if (stamp_ns != 0) return stamp_ns;
  throw usage_error(option + ": a map cannot hold the time 0, which says that there is none",
                    fmt::format("leave {} out to store no time", option));
}

std::string parse_choice(const std::string& option, const std::string& text,
                         const std::vector<std::string>& choices) {
  for (const std::string& choice : choices) {
    if (text == choice) return choice;
  }
  throw usage_error(fmt::format("{} takes one of {}; not '{}'", option, join(choices), text),
                    did_you_mean(text, choices, "allowed: " + join(choices)));
}

std::map<std::string, std::string> parse_pairs(const std::string& option,
                                               const std::vector<std::string>& texts, bool at_last) {
  std::map<std::string, std::string> pairs;
  for (const std::string& text : texts) {
    const std::size_t at = at_last ? text.rfind('=') : text.find('=');
    if (at == std::string::npos || at == 0) throw refused(option, text, "NAME=VALUE");
    if (!pairs.emplace(text.substr(0, at), text.substr(at + 1)).second) {
      throw usage_error(fmt::format("{} names '{}' twice", option, text.substr(0, at)));
    }
  }
  return pairs;
}

}  // namespace apgm::tools
