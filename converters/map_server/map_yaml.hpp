#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "converters/map_server/cell_rule.hpp"

namespace apgm::converters {

/// The YAML file of a map.
struct MapYaml {
  std::string image;  ///< as written; relative to the YAML file
  double resolution_m = 0;
  double x_m = 0;  ///< lower-left corner of the picture
  double y_m = 0;
  double yaw_rad = 0;
  CellRule rule;
};

/// @throws Error{kUnreadable|kForeign|kDamaged|kUnsupported|kLimit}; each missing or bad key by its name
MapYaml read_map_yaml(const std::string& path);
/// The file as text.
std::string to_text(const MapYaml& map);
/// The picture's path: `image` itself if absolute, else beside the YAML file.
std::string image_path(const std::string& yaml_path, const std::string& image);
/// Path of the picture a YAML file names; nullopt if there is no such file, or none that names one.
std::optional<std::string> picture_of(const std::string& yaml_path);
/// True if the text looks like a map's YAML: keys `image` and `resolution` at line starts.
bool is_map_yaml(std::string_view head);

}  // namespace apgm::converters
