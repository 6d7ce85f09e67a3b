#include "converters/map_server/map_yaml.hpp"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <filesystem>
#include <vector>

#include "apgm/core/error.hpp"
#include "converters/common/file.hpp"
#include "converters/common/settings.hpp"

namespace apgm::converters {
namespace {

constexpr std::uint64_t kMaxYamlBytes = 1 << 20;

[[noreturn]] void bad_key(const std::string& key, const std::string& why, const char* hint = "") {
  throw Error(ErrorCode::kDamaged, "key '" + key + "' of the map " + why).hint(hint);
}

YAML::Node value_of(const YAML::Node& map, const std::string& key) {
  YAML::Node node = map[key];
  if (!node || node.IsNull()) {
    bad_key(key, "is missing", "a map has image, resolution, origin, negate, occupied_thresh, free_thresh");
  }
  return node;
}

double as_number(const YAML::Node& node, const std::string& key) {
  double value = 0;
  if (!node.IsScalar() || !YAML::convert<double>::decode(node, value) || !std::isfinite(value)) {
    bad_key(key, "is not a finite number");
  }
  return value;
}

void read_origin(const YAML::Node& map, MapYaml& out) {
  const YAML::Node node = value_of(map, "origin");
  if (!node.IsSequence() || node.size() != 3) bad_key("origin", "is not a list of x, y and yaw");
  out.x_m = as_number(node[0], "origin");
  out.y_m = as_number(node[1], "origin");
  out.yaw_rad = as_number(node[2], "origin");
  if (std::fabs(out.x_m) > 1e9 || std::fabs(out.y_m) > 1e9) bad_key("origin", "lies beyond 1e9 m");
  if (std::fabs(out.yaw_rad) > 1e3) bad_key("origin", "has a yaw beyond 1000 rad");
}

bool read_negate(const YAML::Node& map) {
  const YAML::Node node = value_of(map, "negate");
  int number = 0;
  bool flag = false;
  if (node.IsScalar() && YAML::convert<int>::decode(node, number)) return number != 0;
  if (node.IsScalar() && YAML::convert<bool>::decode(node, flag)) return flag;
  bad_key("negate", "is neither 0, 1, true nor false");
}

MapYaml parse(const YAML::Node& map) {
  if (!map.IsMap()) throw Error(ErrorCode::kForeign, "not a map_server file: it holds no keys");
  MapYaml out;
  const YAML::Node image = value_of(map, "image");
  if (!image.IsScalar() || image.Scalar().empty()) bad_key("image", "is not a file name");
  out.image = image.Scalar();
  out.resolution_m = as_number(value_of(map, "resolution"), "resolution");
  if (!(out.resolution_m >= 1e-5 && out.resolution_m <= 1e4)) {
    bad_key("resolution", "is not a number of metres in 0.00001..10000");
  }
  read_origin(map, out);
  out.rule.negate = read_negate(map);
  out.rule.occupied_thresh = as_number(value_of(map, "occupied_thresh"), "occupied_thresh");
  out.rule.free_thresh = as_number(value_of(map, "free_thresh"), "free_thresh");
  if (const YAML::Node mode = map["mode"]) {
    const auto known = mode.IsScalar() ? map_mode_from(mode.Scalar()) : std::nullopt;
    if (!known) bad_key("mode", "is none of trinary, scale, raw");
    out.rule.mode = *known;
  }
  return out;
}

std::string quoted_if_needed(const std::string& name) {
  YAML::Emitter emitter;
  emitter << name;
  return emitter.c_str();
}

}  // namespace

MapYaml read_map_yaml(const std::string& path) {
  const std::string text = read_file(path, kMaxYamlBytes);
  return naming(path, [&] {
    try {
      return parse(YAML::Load(text));
    } catch (const YAML::Exception& error) {
      const std::string where = error.mark.is_null() ? "" : " in line " + std::to_string(error.mark.line + 1);
      throw Error(ErrorCode::kDamaged, "'" + path + "' is not valid YAML" + where + ": " + error.msg);
    } catch (Error& error) {
      throw Error(error.code(), "'" + path + "': " + error.message()).hint(error.hint());
    }
  });
}

std::string to_text(const MapYaml& map) {
  return "image: " + quoted_if_needed(map.image) + "\nmode: " + std::string(to_string(map.rule.mode)) +
         "\nresolution: " + format_number(map.resolution_m) + "\norigin: [" + format_number(map.x_m) + ", " +
         format_number(map.y_m) + ", " + format_number(map.yaw_rad) +
         "]\nnegate: " + (map.rule.negate ? "1" : "0") +
         "\noccupied_thresh: " + format_number(map.rule.occupied_thresh) +
         "\nfree_thresh: " + format_number(map.rule.free_thresh) + "\n";
}

std::string image_path(const std::string& yaml_path, const std::string& image) {
  return (std::filesystem::path(yaml_path).parent_path() / image).string();
}

bool is_map_yaml(std::string_view head) {
  const auto has_key = [&](std::string_view key) {
    for (std::size_t at = head.find(key); at != std::string_view::npos; at = head.find(key, at + 1)) {
      if (at == 0 || head[at - 1] == '\n') return true;
    }
    return false;
  };
  return head.find('\0') == std::string_view::npos && has_key("image:") && has_key("resolution:");
}

}  // namespace apgm::converters
