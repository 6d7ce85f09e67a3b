#pragma once

#include <gdal.h>
#include <ogr_srs_api.h>

#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "apgm/format/reader.hpp"
#include "apgm/format/writer.hpp"
#include "apgm/ops/copy.hpp"
#include "converters/geotiff/geotiff.hpp"
#include "random_map.hpp"
#include "tests/converters/support.hpp"

namespace apgm::converters::testing {

/// A raster that another program might have made: bands of doubles, the northern row first.
struct RasterSpec {
  int width = 4, height = 3;
  std::vector<std::vector<double>> bands;
  GDALDataType type = GDT_Float32;
  std::array<double, 6> transform{500000, 0.1, 0, 4000000, 0, -0.1};
  int epsg = 32632;  ///< 0: none
  std::optional<double> no_data;
  std::vector<std::string> names;  ///< of bands
  std::map<std::string, std::string> tags;

  std::string save(const std::string& path) const {
    GDALAllRegister();
    void* file = GDALCreate(GDALGetDriverByName("GTiff"), path.c_str(), width, height,
                            static_cast<int>(bands.size()), type, nullptr);
    auto g = transform;
    GDALSetGeoTransform(file, g.data());
    if (epsg != 0) {
      void* crs = OSRNewSpatialReference(nullptr);
      EXPECT_EQ(OSRImportFromEPSG(crs, epsg), OGRERR_NONE);
      GDALSetSpatialRef(file, crs);
      OSRDestroySpatialReference(crs);
    }
    for (const auto& [key, value] : tags) GDALSetMetadataItem(file, key.c_str(), value.c_str(), "APGM");
    for (std::size_t i = 0; i < bands.size(); ++i) {
      void* band = GDALGetRasterBand(file, static_cast<int>(i) + 1);
      if (no_data) GDALSetRasterNoDataValue(band, *no_data);
      if (i < names.size()) GDALSetDescription(band, names[i].c_str());
      auto values = bands[i];
      EXPECT_EQ(values.size(), static_cast<std::size_t>(width * height));
      EXPECT_EQ(
          GDALRasterIO(band, GF_Write, 0, 0, width, height, values.data(), width, height, GDT_Float64, 0, 0),
          CE_None);
    }
    GDALClose(file);
    return path;
  }
};

/// Identity of a source's content, by way of a file.
inline std::string content_id(const PatchSource& source) {
  const TempDir dir;
  Writer writer(dir / "a.apgm", source.header());
  copy(source, source.header().types, writer, true);
  writer.finish();
  return writer.report().content_id;
}

/// What a program prints; nullopt if it is not there.
inline std::optional<std::string> output_of(const std::string& command) {
  FILE* pipe = ::popen((command).c_str(), "r");
  std::string text;
  std::array<char, 4096> buffer;
  for (std::size_t n = 0; (n = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0;) {
    text.append(buffer.data(), n);
  }
  if (::pclose(pipe) == 127 << 8) return {};
  return text;
}

using test::RandomMapOptions;

inline RandomMapOptions one_layer(LayerType type, int step) {
  RandomMapOptions options;
  options.types = {std::move(type)};
  options.min_step = options.max_step = step;
  return options;
}

}  // namespace apgm::converters::testing
