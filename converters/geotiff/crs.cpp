#include "converters/geotiff/crs.hpp"

#include <cpl_conv.h>
#include <gdal.h>
#include <ogr_srs_api.h>

#include <charconv>
#include <cmath>
#include <cstring>
#include <memory>

#include "converters/common/settings.hpp"
#include "converters/geotiff/gdal.hpp"

namespace apgm::converters {
namespace {

struct DestroyCrs {
  void operator()(void* crs) const { OSRDestroySpatialReference(crs); }
};
using Crs = std::unique_ptr<void, DestroyCrs>;

bool in_metres(OGRSpatialReferenceH crs) {
  if (OSRIsProjected(crs) == 0 && OSRIsLocal(crs) == 0) return false;
  return std::fabs(OSRGetLinearUnits(crs, nullptr) - 1) < 1e-12;
}

std::optional<std::int32_t> code_of(OGRSpatialReferenceH crs) {
  const char* part = OSRIsCompound(crs) != 0 ? "PROJCS" : nullptr;
  const char* authority = OSRGetAuthorityName(crs, part);
  const char* code = OSRGetAuthorityCode(crs, part);
  if (authority == nullptr || code == nullptr || std::strcmp(authority, "EPSG") != 0) return {};
  std::int32_t epsg = 0;
  const char* end = code + std::strlen(code);
  const auto [at, error] = std::from_chars(code, end, epsg);
  if (error != std::errc() || at != end || epsg < 1 || epsg > 999'999) return {};
  return epsg;
}

}  // namespace

RasterCrs crs_of(void* dataset) {
  const GdalErrors unseen;
  RasterCrs crs;
  const OGRSpatialReferenceH given = GDALGetSpatialRef(dataset);
  if (given == nullptr) return crs;
  const Crs own(OSRClone(given));
  const char* name = OSRGetName(own.get());
  crs.name = printable(name == nullptr ? "" : name);
  crs.kind = in_metres(own.get()) ? RasterCrs::Kind::kMetres : RasterCrs::Kind::kNotMetres;
  crs.local = OSRIsLocal(own.get()) != 0;
  crs.epsg = code_of(own.get());
  if (!crs.epsg && OSRAutoIdentifyEPSG(own.get()) == OGRERR_NONE) crs.epsg = code_of(own.get());
  return crs;
}

void set_crs(void* dataset, const Frame& frame, const Findings& findings) {
  const GdalErrors unseen;
  const Crs crs(OSRNewSpatialReference(nullptr));
  OSRSetAxisMappingStrategy(crs.get(), OAMS_TRADITIONAL_GIS_ORDER);
  bool known = false;
  if (frame.epsg) {
    known = OSRImportFromEPSG(crs.get(), *frame.epsg) == OGRERR_NONE;
    const bool fits = known && in_metres(crs.get());
    if (!fits && findings) {
      findings({Finding::Kind::kLoss, "EPSG:" + std::to_string(*frame.epsg) +
                                          (known ? " is not in metres" : " is unknown to PROJ") +
                                          ": the raster gets a local CRS"});
    }
    known = fits;
  }
  if (!known) {
    const Crs local(OSRNewSpatialReference(nullptr));
    OSRSetLocalCS(local.get(), frame.frame_id.c_str());
    OSRSetLinearUnits(local.get(), "metre", 1.0);
    GDALSetSpatialRef(dataset, local.get());
    return;
  }
  GDALSetSpatialRef(dataset, crs.get());
}

}  // namespace apgm::converters
