#include <algorithm>
#include <span>

#include "apgm/observe/model.hpp"
#include "apgm/observe/profile.hpp"
#include "observe/parameters.hpp"
#include "yaml/yaml_reader.hpp"

namespace apgm {
namespace {

using observe::Parameter;
using yaml::YamlMap;
using yaml::YamlValue;

/// Reads the keys of one section of the models into their places.
void read_section(const YamlMap& root, std::string_view section, std::span<const Parameter> all) {
  if (!root.has(section)) return;
  std::vector<std::string_view> keys;
  for (const Parameter& p : all) {
    if (p.section == section) keys.push_back(p.key);
  }
  const YamlMap map(root.at(section), keys);
  for (const Parameter& p : all) {
    if (p.section != section || !map.has(p.key)) continue;
    const YamlValue value = map.at(p.key);
    const double number = value.number(p.range());
    if (!p.holds(number)) value.refuse(observe::out_of_range(number), p.range());
    *p.value = number;
  }
}

void read_classes(const YamlMap& root, Models& models) {
  models.classes.clear();
  for (const YamlValue& value : root.at("classes").list()) models.classes.push_back(value.text());
}

void read_kind(const YamlValue& value, Models& models) {
  const std::string name = value.text();
  if (name != "nuss" && name != "richter")
    value.refuse("is '" + name + "', which is no model", "nuss or richter");
  models.kind = name == "nuss" ? ModelKind::kNuss : ModelKind::kRichter;
}

double positive(const YamlValue& value, const char* hint) {
  const double number = value.number(hint);
  if (!(number > 0 && number <= 1e6)) value.refuse(observe::out_of_range(number), hint);
  return number;
}

Point read_point(const YamlValue& value) {
  constexpr const char* kHint = "a corner is [x, y] in metres of the map, within 1e9 m";
  const auto numbers = value.list();
  if (numbers.size() != 2) value.refuse("is not a pair of numbers", kHint);
  const Point p{numbers[0].number(kHint), numbers[1].number(kHint)};
  const auto is_far = [](double v) { return v > 1e9 || v < -1e9; };
  if (is_far(p.x_m) || is_far(p.y_m)) value.refuse("lies beyond 1e9 m", kHint);
  return p;
}

std::vector<Point> read_ring(const YamlValue& value) {
  std::vector<Point> ring;
  for (const YamlValue& corner : value.list()) ring.push_back(read_point(corner));
  if (ring.size() < 3) value.refuse("has fewer than 3 corners", "write [[x, y], [x, y], [x, y]]");
  return ring;
}

/// One ring of corners, or a list of rings.
Polygon read_polygon(const YamlValue& value) {
  const auto parts = value.list();
  const bool has_rings =
      !parts.empty() && parts[0].is_list() && !parts[0].list().empty() && parts[0].list()[0].is_list();
  Polygon polygon;
  if (!has_rings) return {{read_ring(value)}};
  for (const YamlValue& part : parts) polygon.rings.push_back(read_ring(part));
  return polygon;
}

constexpr const char* kCellHint = "metres, a power-of-two part of the patch edge, such as 0.1";
constexpr const char* kRangeHint = "metres from the vehicle, 0 <= from_m < to_m <= 1e6";

Requirement read_band(const YamlValue& value, const std::string& layer, double least_m) {
  const YamlMap band(value, {"from_m", "to_m", "cell_m"});
  Ring ring;
  ring.from_m = band.at("from_m").number(kRangeHint);
  ring.to_m = positive(band.at("to_m"), kRangeHint);
  if (!(ring.from_m >= 0 && ring.from_m < ring.to_m)) value.refuse("ends before it begins", kRangeHint);
  if (ring.from_m < least_m) {
    value.refuse("begins before the band above it ends", "bands ascend and do not overlap");
  }
  return {layer, positive(band.at("cell_m"), kCellHint), ring};
}

void read_requirement(const YamlValue& value, std::vector<Requirement>& out) {
  const YamlMap map(value, {"layer", "horizon_m", "bands", "polygon", "cell_m"});
  const std::string layer = map.at("layer").text();
  if (map.has("horizon_m") + map.has("bands") + map.has("polygon") != 1) {
    map.refuse("has not exactly one of horizon_m, bands and polygon", "an area takes one of them");
  }
  if (map.has("bands")) {
    if (map.has("cell_m")) map.refuse("has bands and a cell_m", "each band has its own cell_m");
    const auto bands = map.at("bands").list();
    if (bands.empty()) map.at("bands").refuse("is empty", "");
    double end_m = 0;
    for (const YamlValue& band : bands) {
      out.push_back(read_band(band, layer, end_m));
      end_m = std::get<Ring>(out.back().area).to_m;
    }
    return;
  }
  Requirement r{layer, positive(map.at("cell_m"), kCellHint), Ring{}};
  if (map.has("horizon_m")) {
    r.area = Ring{0, positive(map.at("horizon_m"), "metres from the vehicle, in (0, 1e6]")};
  } else {
    r.area = read_polygon(map.at("polygon"));
  }
  out.push_back(std::move(r));
}

Profile read_profile(const YamlMap& map) {
  Profile profile;
  if (map.has("name")) profile.name = map.at("name").text();
  for (const YamlValue& value : map.at("requirements").list()) read_requirement(value, profile.requirements);
  return profile;
}

Schedule::Entry read_entry(const YamlValue& value, const Schedule& before) {
  const YamlMap map(value, {"name", "from_s", "requirements"});
  Schedule::Entry entry;
  const bool is_first = before.entries.empty();
  if (map.has("from_s") || !is_first)
    entry.from_s = map.at("from_s").number("seconds since the first measurement");
  if (is_first && entry.from_s != 0) map.at("from_s").refuse("is not 0", "the first profile holds from 0 on");
  if (!is_first && !(entry.from_s > before.entries.back().from_s)) {
    map.at("from_s").refuse("is not later than that of the profile before", "profiles ascend in from_s");
  }
  entry.profile = read_profile(map);
  return entry;
}

}  // namespace

Models parse_models(std::string_view yaml, std::string_view name) {
  const std::string text_name(name);
  const YamlValue text = apgm::yaml::load_yaml(yaml, text_name);
  const YamlMap root(
      text, {"model", "nuss", "richter", "limits", "camera", "occupancy_layer", "semantic_layer", "classes"});
  Models models;
  if (root.has("model")) read_kind(root.at("model"), models);
  const auto all = observe::parameters(models);
  for (const char* section : {"nuss", "richter", "limits", "camera"}) read_section(root, section, all);
  if (root.has("occupancy_layer")) models.occupancy_layer = root.at("occupancy_layer").text();
  if (root.has("semantic_layer")) models.semantic_layer = root.at("semantic_layer").text();
  if (root.has("classes")) read_classes(root, models);
  try {
    models.check();
  } catch (const Error& error) {
    throw Error(error.code(), "'" + text_name + "': " + error.message()).hint(error.hint()).at(text_name);
  }
  return models;
}

Schedule parse_profiles(std::string_view yaml, std::string_view name) {
  const std::string text_name(name);
  const YamlValue text = apgm::yaml::load_yaml(yaml, text_name);
  const YamlMap root(text, {"name", "requirements", "profiles"});
  Schedule schedule;
  if (!root.has("profiles")) {
    schedule.entries.push_back({0, read_profile(root)});
    return schedule;
  }
  if (root.has("requirements") || root.has("name")) {
    root.refuse("has 'profiles' beside 'name' or 'requirements'", "put them into an entry of 'profiles'");
  }
  for (const YamlValue& value : root.at("profiles").list())
    schedule.entries.push_back(read_entry(value, schedule));
  if (schedule.entries.empty()) root.at("profiles").refuse("is empty", "");
  return schedule;
}

}  // namespace apgm
