#pragma once

#include "converters/common/converter.hpp"

namespace apgm::converters {

/// GeoTIFF both ways, and what else GDAL reads as a georeferenced raster (docs/converters.md).
const Converter& geotiff();

}  // namespace apgm::converters
