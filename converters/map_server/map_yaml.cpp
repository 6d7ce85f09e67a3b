#include "converters/map_server/map_yaml.hpp"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <vector>

#include "apgm/core/error.hpp"
#include "converters/common/file.hpp"
#include "converters/common/settings.hpp"

namespace apgm::converters {
namespace {

constexpr std::uint64_t kMaxYamlBytes = 1 << 20;

constexpr const char* kCoordinates = "x and y in metres and yaw in radians: [-1.5, 2, 0]";

[[noreturn]] void bad_key(const std::string& key, const std::string& why, const char* hint) {
  throw Error(ErrorCode::kDamaged, "key '" + key + "' of the map " + why).hint(hint);
}

[[noreturn]] void bad_value(const std::string& key, const YAML::Node& node, const std::string& why,
                            const char* hint) {
  const std::string value = node.IsScalar() ? "is '" + printable(node.Scalar()) + "', which " : "";
  bad_key(key, value + why, hint);
}

/// YAML lets the last of two equal keys win without a word.
void check_once(const YAML::Node& map) {
  std::map<std::string, std::string> seen;
  for (const auto& pair : map) {
    if (!pair.first.IsScalar()) continue;
    const std::string value = pair.second.IsScalar() ? pair.second.Scalar() : "...";
    const auto [first, is_new] = seen.emplace(pair.first.Scalar(), value);
    if (is_new) continue;
    bad_key(printable(first->first),
            "is given twice: '" + printable(first->second) + "' and '" + printable(value) + "'", "keep one");
  }
}

YAML::Node value_of(const YAML::Node& map, const std::string& key) {
  YAML::Node node = map[key];
  if (!node || node.IsNull()) {
    bad_key(key, "is missing", "a map has image, resolution, origin, negate, occupied_thresh, free_thresh");
  }
  return node;
}

double as_number(const YAML::Node& node, const std::string& key, const char* hint) {
  double value = 0;
  if (!node.IsScalar() || !YAML::convert<double>::decode(node, value) || !std::isfinite(value)) {
    bad_value(key, node, "is not a finite number", hint);
  }
  return value;
}

void read_origin(const YAML::Node& map, MapYaml& out) {
  const YAML::Node node = value_of(map, "origin");
  if (!node.IsSequence() || node.size() != 3)
    bad_value("origin", node, "is not a list of x, y and yaw", kCoordinates);
  out.x_m = as_number(node[0], "origin", kCoordinates);
  out.y_m = as_number(node[1], "origin", kCoordinates);
  out.yaw_rad = as_number(node[2], "origin", kCoordinates);
  const auto limit = [](const YAML::Node& part, double value, double most, const char* what) {
    if (std::fabs(value) > most) bad_key("origin", "holds " + printable(part.Scalar()) + what, kCoordinates);
  };
  limit(node[0], out.x_m, 1e9, ", which lies beyond 1e9 m");
  limit(node[1], out.y_m, 1e9, ", which lies beyond 1e9 m");
  limit(node[2], out.yaw_rad, 1e3, ", a yaw beyond 1000 rad");
}

double read_resolution(const YAML::Node& map) {
  constexpr const char* kHint = "metres a pixel, such as 0.05";
  const YAML::Node node = value_of(map, "resolution");
  const double value = as_number(node, "resolution", kHint);
  if (!(value >= 1e-5 && value <= 1e4))
    bad_value("resolution", node, "is not a number of metres in 0.00001..10000", kHint);
  return value;
}

bool read_negate(const YAML::Node& map) {
  const YAML::Node node = value_of(map, "negate");
  const std::string text = node.IsScalar() ? node.Scalar() : "";
  if (text == "0" || text == "false") return false;
  if (text == "1" || text == "true") return true;
  bad_value("negate", node, "is neither 0, 1, true nor false", "0: dark is occupied, 1: light is");
}

double read_threshold(const YAML::Node& map, const char* key) {
  constexpr const char* kHint = "usual are occupied_thresh 0.65 and free_thresh 0.196";
  const YAML::Node node = value_of(map, key);
  const double value = as_number(node, key, kHint);
  if (value < 0 || value > 1) bad_value(key, node, "does not lie in 0..1", kHint);
  return value;
}

void read_thresholds(const YAML::Node& map, CellRule& rule) {
  rule.occupied_thresh = read_threshold(map, "occupied_thresh");
  rule.free_thresh = read_threshold(map, "free_thresh");
  if (rule.free_thresh <= rule.occupied_thresh) return;
  bad_value("free_thresh", map["free_thresh"],
            "lies above occupied_thresh " + printable(map["occupied_thresh"].Scalar()),
            "the two may have been mixed up");
}

MapYaml parse(const YAML::Node& map) {
  if (!map.IsMap()) {
    throw Error(ErrorCode::kForeign, "not a map_server file: it holds no keys")
        .hint("a map has image, resolution, origin, negate, occupied_thresh, free_thresh");
  }
  check_once(map);
  MapYaml out;
  const YAML::Node image = value_of(map, "image");
  if (!image.IsScalar() || image.Scalar().empty() || image.Scalar().find('\0') != std::string::npos)
    bad_value("image", image, "is not a file name", "the picture's name, seen from the YAML's directory");
  out.image = image.Scalar();
  out.resolution_m = read_resolution(map);
  read_origin(map, out);
  out.rule.negate = read_negate(map);
  read_thresholds(map, out.rule);
  if (const YAML::Node mode = map["mode"]) {
    const auto known = mode.IsScalar() ? map_mode_from(mode.Scalar()) : std::nullopt;
    if (!known) bad_value("mode", mode, "is none of trinary, scale, raw", "without this key it is trinary");
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
      throw Error(ErrorCode::kDamaged,
                  "'" + path + "' is not valid YAML" + where + ": " + printable(error.msg))
          .hint("a map has one 'key: value' a line");
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

std::optional<std::string> picture_of(const std::string& yaml_path) {
  try {
    const YAML::Node map = YAML::Load(read_file(yaml_path, kMaxYamlBytes));
    const YAML::Node image = map.IsMap() ? map["image"] : YAML::Node();
    if (!image.IsDefined() || !image.IsScalar() || image.Scalar().empty()) return {};
    return image_path(yaml_path, image.Scalar());
  } catch (const YAML::Exception&) {
    return {};
  } catch (const Error&) {
    return {};
  }
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
