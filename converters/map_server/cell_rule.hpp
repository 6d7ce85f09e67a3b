#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "converters/map_server/picture.hpp"

namespace apgm::converters {

enum class MapMode : std::uint8_t { kTrinary, kScale, kRaw };
inline constexpr std::array<std::string_view, 3> kMapModes{"trinary", "scale", "raw"};
std::optional<MapMode> map_mode_from(std::string_view name);
std::string_view to_string(MapMode mode);

/// Value of a cell as in nav_msgs/OccupancyGrid: -1 unknown, 0 free to 100 occupied.
using GridValue = std::int8_t;
inline constexpr GridValue kUnknown = -1, kFree = 0, kOccupied = 100;

/// How a pixel becomes a cell; the semantics of nav2's map_io.
struct CellRule {
  MapMode mode = MapMode::kTrinary;
  bool negate = false;
  double occupied_thresh = 0.65;
  double free_thresh = 0.196;

  /// With `has_alpha`, trinary averages alpha in with the colours, and scale takes what is not opaque as
  /// unknown.
  GridValue value_of(const Pixel& pixel, bool has_alpha) const;
  /// The same for an opaque grey of 8 bits.
  GridValue value_of_grey(int grey) const;
};

/// The greys of a picture that reads back as the values that were meant.
struct GreyTable {
  std::array<std::uint8_t, 101> grey{};
  std::uint8_t unknown = 0;
  std::uint8_t of(GridValue value) const {
    return value == kUnknown ? unknown : grey[static_cast<std::size_t>(value)];
  }
};

/// Trinary: 0, 205 and 254 (map_server's own) where the thresholds read them right, else the nearest greys
/// that are. Scale: the greys nearest to the line between the thresholds. Raw: the values themselves, 255
/// unknown.
/// @throws Error{kInvalidArgument} if no grey reads back as one of the values
GreyTable grey_table(const CellRule& rule);

}  // namespace apgm::converters
