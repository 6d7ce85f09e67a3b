#include "apgm/core/error.hpp"
#include "apgm/layouts/nonuniform_grid.hpp"
#include "yaml/yaml_reader.hpp"

namespace apgm {
namespace {

using yaml::YamlMap;
using yaml::YamlValue;

constexpr const char* kBoundsHint = "[from, to] in metres from the vehicle";
constexpr const char* kCellHint = "metres; [width, height] for cells that are not square";

struct Pair {
  double first = 0, second = 0;
};

Pair read_pair(const YamlValue& value, const char* hint) {
  const auto numbers = value.list();
  if (numbers.size() != 2) value.refuse("is not a pair of numbers", hint);
  return {numbers[0].number(hint), numbers[1].number(hint)};
}

LayoutRectangle read_rectangle(const YamlValue& value) {
  const YamlMap map(value, {"x_m", "y_m", "cell_m"});
  const Pair x = read_pair(map.at("x_m"), kBoundsHint), y = read_pair(map.at("y_m"), kBoundsHint);
  const YamlValue cell = map.at("cell_m");
  Pair side;
  if (cell.is_list()) {
    side = read_pair(cell, kCellHint);
  } else {
    side.first = side.second = cell.number(kCellHint);
  }
  return {x.first, x.second, y.first, y.second, side.first, side.second};
}

}  // namespace

NonUniformPlan parse_plan(std::string_view yaml, std::string_view name) {
  const std::string text_name(name);
  const YamlValue text = apgm::yaml::load_yaml(yaml, text_name);
  const YamlMap root(text, {"name", "rectangles"});
  NonUniformPlan plan;
  plan.name = root.has("name") ? root.at("name").text() : text_name;
  for (const YamlValue& value : root.at("rectangles").list())
    plan.rectangles.push_back(read_rectangle(value));
  try {
    plan.check();
  } catch (const Error& error) {
    throw Error(error.code(), "'" + text_name + "': " + error.message()).hint(error.hint()).at(text_name);
  }
  return plan;
}

}  // namespace apgm
