#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "apgm/core/frame.hpp"

namespace apgm::tools {

/// Coordinates the library takes lie within it (Frame::patches_meeting).
inline constexpr double kMaxCoordinate_m = 4e9;

// Reading values, strictly: the whole text or nothing. @throws Error{kInvalidArgument} naming the option and
// what it takes.

double parse_real(const std::string& option, std::string_view text);
double parse_positive(const std::string& option, std::string_view text);
/// In [min, max].
double parse_real(const std::string& option, std::string_view text, double min, double max);
/// @param hint  what the numbers mean
std::int64_t parse_integer(const std::string& option, std::string_view text, std::int64_t min,
                           std::int64_t max, const std::string& hint = {});
/// Bytes: "1500000", "512M" and "512MiB" (powers of 1024), "1.5GB" (powers of 1000)
std::uint64_t parse_size(const std::string& option, std::string_view text);
/// "XMIN,YMIN,XMAX,YMAX" in metres, not inverted, not empty, within kMaxCoordinate_m; blanks may surround
/// numbers.
Box parse_box(const std::string& option, std::string_view text);
/// Nanoseconds since 1970: "now", "@SECONDS", "2026-01-31T12:00:00Z"
std::int64_t parse_time(const std::string& option, std::string_view text);
/// A time to store: not 0, which stands for none.
std::int64_t parse_stamp(const std::string& option, std::string_view text);
/// The forms of a time, for help texts.
inline constexpr const char* kTimeForms =
    "2026-01-31T12:00:00Z (UTC, whole seconds), @SECONDS since 1970, or now";
/// One of `choices`.
std::string parse_choice(const std::string& option, const std::string& text,
                         const std::vector<std::string>& choices);
/// KEY=VALUE pairs, each key once. The last '=' divides where `at_last` is set.
std::map<std::string, std::string> parse_pairs(const std::string& option,
                                               const std::vector<std::string>& texts, bool at_last = false);

}  // namespace apgm::tools
