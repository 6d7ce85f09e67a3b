#pragma once

#include <string>

#include "apgm/ops/crop.hpp"

namespace apgm::tools {

/// Reads the areas of a GeoJSON file: Polygon, MultiPolygon, Feature or FeatureCollection. Coordinates are
/// taken as metres of the map's CRS. All rings together follow the even-odd rule.
/// @throws Error{kUnreadable} if the file cannot be read, {kForeign} if it is not JSON or holds no area
///         (naming the member that is wrong), {kLimit} beyond 64 MiB
Polygon read_geojson(const std::string& path);

/// As read_geojson, from text; `path` stands in messages.
Polygon parse_geojson(const std::string& text, const std::string& path);

}  // namespace apgm::tools
