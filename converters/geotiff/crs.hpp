#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "apgm/core/error.hpp"
#include "apgm/core/frame.hpp"

namespace apgm::converters {

/// The coordinate reference system of a raster, as far as a map can take it.
struct RasterCrs {
  enum class Kind : std::uint8_t {
    kNone,       ///< the raster does not say
    kMetres,     ///< projected or local, in metres
    kNotMetres,  ///< degrees, feet, ...
  } kind = Kind::kNone;
  std::optional<std::int32_t> epsg;  ///< of the horizontal part, where it is known
  bool local = false;                ///< an engineering CRS: says that there is no EPSG code
  std::string name;                  ///< for messages
};

/// Reads the CRS of an open dataset.
RasterCrs crs_of(void* dataset);

/// Gives a dataset the CRS of a map: that of its EPSG code, or without one a local CRS in metres that is
/// named after the frame. A code PROJ does not know or that is not in metres is a kLoss finding: the raster
/// then gets the local CRS, too.
void set_crs(void* dataset, const Frame& frame, const Findings& findings);

}  // namespace apgm::converters
