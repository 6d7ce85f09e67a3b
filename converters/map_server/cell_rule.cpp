#include "converters/map_server/cell_rule.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "apgm/core/error.hpp"

namespace apgm::converters {
namespace {

constexpr double kWhite = 65535;

/// The grey nearest to `wanted` that reads back as `value`.
std::uint8_t find_grey(const CellRule& rule, GridValue value, double wanted) {
  int best = -1;
  for (int grey = 0; grey < 256; ++grey) {
    if (rule.value_of_grey(grey) != value) continue;
    if (best < 0 || std::fabs(grey - wanted) < std::fabs(best - wanted)) best = grey;
  }
  if (best >= 0) return static_cast<std::uint8_t>(best);
  const std::string name = value == kUnknown ? "unknown" : "value " + std::to_string(value);
  throw Error(ErrorCode::kInvalidArgument, "with these thresholds no grey of a picture means " + name)
      .hint("set occupied_thresh and free_thresh, as 0.65 and 0.196 for trinary, 1 and 0 for scale");
}

double middle_grey(const CellRule& rule) {
  const double occupancy = (rule.occupied_thresh + rule.free_thresh) / 2;
  return 255 * (rule.negate ? occupancy : 1 - occupancy);
}

GreyTable trinary_table(const CellRule& rule) {
  const auto own = [&](int grey) { return rule.negate ? 255 - grey : grey; };
  GreyTable table;
  table.grey[kFree] = find_grey(rule, kFree, own(254));
  table.grey[kOccupied] = find_grey(rule, kOccupied, own(0));
  const bool usual = rule.value_of_grey(own(205)) == kUnknown;
  table.unknown = find_grey(rule, kUnknown, usual ? own(205) : middle_grey(rule));
  return table;
}

GreyTable scale_table(const CellRule& rule) {
  GreyTable table;
  table.unknown = 127;  // seen by no reader: the pixel is transparent
  for (int value = 0; value <= 100; ++value) {
    const double occupancy = rule.free_thresh + value / 100.0 * (rule.occupied_thresh - rule.free_thresh);
    const double wanted = 255 * (rule.negate ? occupancy : 1 - occupancy);
    table.grey[static_cast<std::size_t>(value)] = find_grey(rule, static_cast<GridValue>(value), wanted);
  }
  return table;
}

}  // namespace

std::optional<MapMode> map_mode_from(std::string_view name) {
  const auto it = std::ranges::find(kMapModes, name);
  if (it == kMapModes.end()) return {};
  return static_cast<MapMode>(it - kMapModes.begin());
}

std::string_view to_string(MapMode mode) { return kMapModes.at(static_cast<std::size_t>(mode)); }

GridValue CellRule::value_of(const Pixel& pixel, bool has_alpha) const {
  double sum = static_cast<double>(pixel.red) + pixel.green + pixel.blue;
  int channels = 3;
  if (mode == MapMode::kTrinary && has_alpha) {
    sum += pixel.alpha;
    ++channels;
  }
  const double shade = sum / channels / kWhite;
  const double occupancy = negate ? shade : 1.0 - shade;
  if (mode == MapMode::kRaw) {
    const double value = std::round(shade * 255);
    return value <= kOccupied ? static_cast<GridValue>(value) : kUnknown;
  }
  if (mode == MapMode::kScale && has_alpha && pixel.alpha != 65535) return kUnknown;
  if (occupied_thresh < occupancy) return kOccupied;
  if (occupancy < free_thresh) return kFree;
  // Between equal thresholds there is no scale.
  if (mode == MapMode::kTrinary || !(free_thresh < occupied_thresh)) return kUnknown;
  const double scaled = std::rint((occupancy - free_thresh) / (occupied_thresh - free_thresh) * 100.0);
  return static_cast<GridValue>(std::clamp<double>(scaled, kFree, kOccupied));
}

GridValue CellRule::value_of_grey(int grey) const {
  const auto v = static_cast<std::uint16_t>(grey * 257);
  return value_of({v, v, v, 65535}, false);
}

GreyTable grey_table(const CellRule& rule) {
  if (rule.mode == MapMode::kTrinary) return trinary_table(rule);
  if (rule.mode == MapMode::kScale) return scale_table(rule);
  GreyTable table;
  table.unknown = 255;
  for (int value = 0; value <= 100; ++value) {
    table.grey[static_cast<std::size_t>(value)] = static_cast<std::uint8_t>(value);
  }
  return table;
}

}  // namespace apgm::converters
