#include "converters/geotiff/geotiff.hpp"

#include <algorithm>
#include <cctype>

#include "converters/geotiff/export.hpp"
#include "converters/geotiff/import.hpp"
#include "converters/geotiff/raster.hpp"

namespace apgm::converters {
namespace {

bool starts_like_ascii_grid(std::string_view head) {
  std::string word(head.substr(0, 5));
  for (char& c : word) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return word == "ncols" && head.size() > 5 && (head[5] == ' ' || head[5] == '\t');
}

class GeoTiffConverter final : public Converter {
 public:
  std::string_view name() const override { return "geotiff"; }
  std::string_view description() const override {
    return "GeoTIFF; reads ESRI ASCII grid and BIL, ERDAS Imagine and ENVI, too";
  }
  std::vector<std::string> extensions() const override { return {".tif", ".tiff"}; }

  std::vector<SettingSpec> settings() const override {
    std::vector<SettingSpec> specs{
        {"as", "what the values are: masses, classes, probability or value",
         "as written; classes where the raster names its values"},
        {"band", "the only band that is read, from 1", "all; 1 for classes and probability"},
        {"layer", "name of the map's layer", "occupancy, semantic or value"},
        {"channels", "A,B,...: names of the bands; the last may be Omega", "as the bands are called"},
        {"legend", "FILE of 'code,name' (.csv) or 'code: name' (.yaml): classes of values", "", true, false,
         true},
        {"class_mass", "mass of a class, in 0.000001..1", "0.9"},
        {"unknown_class", "class of codes the legend does not name: error, Omega or a class", "error"},
        {"invalid", "cells with masses or values out of range: error or unknown", "error"},
        {"policy", "resampling policy of the layer", "conditional, evidence; mean for classes and value"},
        {"cell_m", "side of a cell, metres, where pixels are not square", ""},
        {"allow_no_crs", "1: a raster without CRS is in metres of an unknown one", "0"},
        {"mode", "masses or classes", "masses", false, true},
        {"step", "resolution step of the raster, 0..11", "the finest present", false, true},
        {"compression", "zstd, deflate or none", "zstd", false, true},
        {"level", "of the compression: zstd 1..19, deflate 1..9", "3; deflate 6", false, true}};
    for (const SettingSpec& spec : frame_settings()) {
      specs.push_back(spec);
      if (spec.key == "datum") specs.back().default_value = "the raster's south-west corner";
      if (spec.key == "edge_m") specs.back().default_value += "; 128 cells of more than 1 m";
      if (spec.key == "epsg") specs.back().default_value = "the raster's";
    }
    return specs;
  }

  std::vector<std::string> losses() const override {
    return {"reading probability: cells of 0.5 become cells without data",
            "reading: values are rounded to float32",
            "writing: one layer; all cells get one size, the finest present",
            "writing classes: the class of the greatest BetP; masses are lost",
            "writing: metadata and history are left out"};
  }

  bool sniffs(std::string_view /*path*/, std::span<const std::byte> head) const override {
    const std::string_view text(reinterpret_cast<const char*>(head.data()), head.size());
    using namespace std::string_view_literals;
    return text.starts_with("II*\0"sv) || text.starts_with("MM\0*"sv) || text.starts_with("II+\0"sv) ||
           text.starts_with("MM\0+"sv) || text.starts_with("EHFA_HEADER_TAG") || starts_like_ascii_grid(text);
  }
  void check_settings(const Settings& given, Use use) const override {
    const SettingsReader settings(*this, given, use);
    use == Use::kReading ? check_raster_import(settings) : check_raster_export(settings);
  }
  std::vector<std::string> files_read(const std::string& path) const override {
    return files_of_raster(path);
  }
  std::vector<std::string> files_written(const MapHeader& /*header*/,
                                         const WriteRequest& request) const override {
    return raster_files(request, SettingsReader(*this, request.settings, Use::kWriting));
  }
  void check_replaceable(const MapHeader& /*header*/, const WriteRequest& request) const override {
    check_side_file(request);
  }
  std::unique_ptr<PatchSource> open(const ReadRequest& request) const override {
    return import_raster(request, *this);
  }
  void write(const PatchSource& source, const WriteRequest& request) const override {
    export_raster(source, request, SettingsReader(*this, request.settings, Use::kWriting));
  }
};

}  // namespace

const Converter& geotiff() {
  static const GeoTiffConverter converter;
  return converter;
}

}  // namespace apgm::converters
