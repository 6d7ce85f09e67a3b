#pragma once

#include <string>
#include <vector>

#include "apgm/core/layer_type.hpp"
#include "converters/geotiff/tiff_file.hpp"

namespace apgm::converters {

/// The file GDAL reads with a raster, for what a TIFF has no place for.
std::string legend_file_of(const std::string& tiff);
/// Its text: the names of the values, 0 `unknown`, then the hypotheses.
std::string legend_file(const LayerType& type);
/// Colours of the values: 0 transparent, then those apgm-render gives the hypotheses.
std::vector<TiffColour> class_colours(const LayerType& type);

}  // namespace apgm::converters
