#include "converters/map_server/map_server.hpp"

#include "converters/map_server/export.hpp"
#include "converters/map_server/import.hpp"
#include "converters/map_server/map_yaml.hpp"

namespace apgm::converters {
namespace {

class MapServerConverter final : public Converter {
 public:
  std::string_view name() const override { return "map_server"; }
  std::string_view description() const override {
    return "nav2 map_server maps: YAML with a PGM or PNG picture";
  }
  std::vector<std::string> extensions() const override { return {".yaml", ".yml"}; }

  std::vector<SettingSpec> settings() const override {
    std::vector<SettingSpec> specs{
        {"mode", "trinary, scale or raw", "that of the map, else trinary", true, true},
        {"occupied_mass", "reading, trinary: m(O) of an occupied cell, in 0.000001..1", "0.9"},
        {"free_mass", "reading, trinary: m(F) of a free cell, in 0.000001..1", "0.9"},
        {"occupied_thresh", "writing: darker than this is occupied, 0..1",
         "that of the map, else 0.65; scale 1", false, true},
        {"free_thresh", "writing: lighter than this is free, 0..1", "that of the map, else 0.196; scale 0",
         false, true},
        {"negate", "writing: 1 for white as occupied", "that of the map, else 0", false, true},
        {"image", "writing: pgm or png", "pgm; png for mode scale", false, true}};
    for (const SettingSpec& spec : frame_settings()) {
      specs.push_back(spec);
      if (spec.key == "datum") specs.back().default_value = "the map's origin";
    }
    return specs;
  }

  std::vector<std::string> losses() const override {
    return {"reading scale and raw: cells of value 50 (probability 0.5) become cells without data",
            "writing trinary: a cell is occupied, free or unknown; masses are lost",
            "writing scale and raw: BetP(O) in percent",
            "writing: all cells get the finest size present; a coarser cell is painted whole",
            "writing: EPSG, frame id, time, metadata, and all other layers are left out"};
  }

  bool sniffs(std::string_view /*path*/, std::span<const std::byte> head) const override {
    return is_map_yaml({reinterpret_cast<const char*>(head.data()), head.size()});
  }
  void check_settings(const Settings& given, Use use) const override {
    const SettingsReader settings(*this, given, use);
    use == Use::kReading ? check_import_settings(settings) : check_export_settings(settings);
  }
  std::vector<std::string> files_read(const std::string& path) const override {
    std::vector<std::string> files{path};
    if (const auto picture = picture_of(path)) files.push_back(*picture);
    return files;
  }
  std::vector<std::string> files_written(const MapHeader& header,
                                         const WriteRequest& request) const override {
    return exported_files(header, request, SettingsReader(*this, request.settings, Use::kWriting));
  }
  void check_replaceable(const MapHeader& header, const WriteRequest& request) const override {
    check_picture(request.path, files_written(header, request).back(), request.output);
  }
  std::unique_ptr<PatchSource> open(const ReadRequest& request) const override {
    return import_map(request, SettingsReader(*this, request.settings, SettingsReader::Use::kReading));
  }
  void write(const PatchSource& source, const WriteRequest& request) const override {
    export_map(source, request, SettingsReader(*this, request.settings, SettingsReader::Use::kWriting));
  }
};

}  // namespace

const Converter& map_server() {
  static const MapServerConverter converter;
  return converter;
}

}  // namespace apgm::converters
