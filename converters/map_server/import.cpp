#include "converters/map_server/import.hpp"

#include <algorithm>

#include "converters/common/file.hpp"
#include "converters/map_server/picture_source.hpp"

namespace apgm::converters {
namespace {

BeliefTable beliefs_of(const CellRule& rule, double occupied_mass, double free_mass) {
  BeliefTable beliefs{};
  for (int value = 0; value <= 100; ++value) {
    Masses& masses = beliefs[static_cast<std::size_t>(value + 1)];
    if (rule.mode != MapMode::kTrinary) {
      masses = masses_from_probability(value / 100.0);
    } else if (value == kOccupied) {
      masses.occupied = static_cast<float>(occupied_mass);
    } else if (value == kFree) {
      masses.free = static_cast<float>(free_mass);
    }
  }
  return beliefs;
}

std::map<std::string, std::string> metadata_of(const MapYaml& map, const CellRaster& cells,
                                               const GridFit& fit, double occupied_mass, double free_mass) {
  std::map<std::string, std::string> m;
  m["map_server.mode"] = to_string(map.rule.mode);
  m["map_server.negate"] = map.rule.negate ? "1" : "0";
  m["map_server.occupied_thresh"] = format_number(map.rule.occupied_thresh);
  m["map_server.free_thresh"] = format_number(map.rule.free_thresh);
  if (map.rule.mode == MapMode::kTrinary) {
    m["map_server.occupied_mass"] = format_number(occupied_mass);
    m["map_server.free_mass"] = format_number(free_mass);
  }
  m["map_server.resolution"] = format_number(map.resolution_m);
  if (!fit.target) {  // else the cells are no longer those of the picture
    m["map_server.origin"] = format_number(map.x_m) + "," + format_number(map.y_m);
    m["map_server.width"] = std::to_string(cells.width);
    m["map_server.height"] = std::to_string(cells.height);
  }
  return m;
}

void report_even(const CellRaster& cells, MapMode mode, const Findings& findings) {
  if (mode == MapMode::kTrinary || !findings) return;
  const auto even = std::count(cells.values.begin(), cells.values.end(), GridValue{50});
  if (even == 0) return;
  findings({Finding::Kind::kLoss, std::to_string(even) + " cells of value 50 become cells without data"});
}

}  // namespace

void check_import_settings(const SettingsReader& settings) {
  settings.choice("mode", kMapModes);
  settings.number("occupied_mass", 1e-6, 1);
  settings.number("free_mass", 1e-6, 1);
  fit_grid({1.0, {}, 0}, settings, {});
}

std::unique_ptr<PatchSource> import_map(const ReadRequest& request, const SettingsReader& settings) {
  check_import_settings(settings);
  const auto mode = settings.choice("mode", kMapModes);
  const double occupied_mass = settings.number("occupied_mass", 1e-6, 1).value_or(kTrinaryMass);
  const double free_mass = settings.number("free_mass", 1e-6, 1).value_or(kTrinaryMass);
  MapYaml map = read_map_yaml(request.path);
  if (mode) map.rule.mode = *map_mode_from(*mode);
  if (map.rule.mode == MapMode::kScale && !(map.rule.free_thresh < map.rule.occupied_thresh)) {
    throw Error(ErrorCode::kDamaged, "'" + request.path + "': free_thresh is not below occupied_thresh")
        .hint("mode scale needs a range between them")
        .at(request.path);
  }
  const ForeignGrid grid{map.resolution_m, {map.x_m, map.y_m}, map.yaw_rad};
  const GridFit fit = naming(request.path, [&] { return fit_grid(grid, settings, request.findings); });

  const std::string picture = image_path(request.path, map.image);
  CellRaster cells;
  try {
    cells = read_cells(picture, map.rule, request.max_memory_bytes);
  } catch (Error& error) {
    const bool missing = error.code() == ErrorCode::kUnreadable;
    throw Error(error.code(),
                "picture '" + printable(map.image) + "' of '" + request.path + "': " + error.message())
        .hint(missing ? "key 'image' of the YAML names it, seen from the YAML's directory" : error.hint())
        .at(printable(picture), error.offset_bytes());
  }
  report_even(cells, map.rule.mode, request.findings);
  const std::uint64_t left = budget_left(request.max_memory_bytes, cells.values.size());
  auto metadata = metadata_of(map, cells, fit, occupied_mass, free_mass);
  auto native = naming(request.path, [&] {
    return std::make_unique<PictureSource>(std::move(cells), beliefs_of(map.rule, occupied_mass, free_mass),
                                           fit, std::move(metadata), left);
  });
  return place(std::move(native), grid, fit, request.findings, left);
}

}  // namespace apgm::converters
