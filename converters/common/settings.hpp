#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "apgm/core/frame.hpp"
#include "converters/common/converter.hpp"

namespace apgm::converters {

/// The settings of one call, checked against what a converter lists. Numbers are strict: the whole text,
/// finite, with '.', whatever the locale.
///
/// All members throw Error{kInvalidArgument} that names the key, the value and what would do.
class SettingsReader {
 public:
  using Use = converters::Use;
  /// @throws Error{kInvalidArgument} on a key the converter does not list for this use, with the list as hint
  SettingsReader(const Converter& converter, const Settings& settings, Use use);

  bool has(const std::string& key) const { return settings_.contains(key); }
  std::optional<std::string> text(const std::string& key) const;
  std::optional<double> number(const std::string& key) const;
  /// A number in [low, high].
  std::optional<double> number(const std::string& key, double low, double high) const;
  /// "X,Y".
  std::optional<Point> point(const std::string& key) const;
  /// One of `names`.
  std::optional<std::string> choice(const std::string& key, std::span<const std::string_view> names) const;
  /// "0"/"false" or "1"/"true".
  std::optional<bool> flag(const std::string& key) const;

  /// Refuses a value for a reason of the converter's own.
  [[noreturn]] void refuse(const std::string& key, const std::string& why) const;

 private:
  std::string format_;
  const Settings& settings_;
};

/// The settings every reader has: `datum`, `edge_m`, `frame_id`, `epsg`.
std::vector<SettingSpec> frame_settings();

/// Takes frame_id and epsg into `frame`; datum and edge_m are for fit_grid (grid_fit.hpp).
void read_names(const SettingsReader& settings, Frame& frame);

/// Bytes of a file for a message: control characters and what is not UTF-8 become \xNN, more than 80 bytes
/// are cut.
std::string printable(std::string_view text);

/// A finite double from the whole of `text`; nullopt if it is none.
std::optional<double> parse_number(std::string_view text);
/// Shortest decimal text that reads back as `value`.
std::string format_number(double value);

}  // namespace apgm::converters
