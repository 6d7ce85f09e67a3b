#include "converters/fixed_grid/choose_layout.hpp"

#include <algorithm>
#include <array>

#include "apgm/core/error.hpp"
#include "apgm/core/summary.hpp"
#include "apgm/layouts/description.hpp"
#include "apgm/layouts/moving_grid.hpp"
#include "converters/common/file.hpp"

namespace apgm::converters {
namespace {

constexpr std::array<std::string_view, 9> kLayouts{
    "A", "B", "C", "moving", "dense_array", "hash_map", "quadtree", "sorted_vector", "cow_tiles"};
constexpr std::uint64_t kMaxPlanBytes = 1 << 20;
constexpr double kHalfExtent_m = 100;

NonUniformPlan plan_from(const std::string& path) {
  return naming(path, [&] { return parse_plan(read_file(path, kMaxPlanBytes), path); });
}

}  // namespace

double finest_cell_m(const PatchSource& map) {
  return map.header().frame.cell_m(finest_step(map.summary()).value_or(0));
}

Point middle_of(const PatchSource& map) {
  const PatchRange range = map.summary().range;
  if (range.empty()) return map.header().frame.datum_m();
  const Box box = map.header().frame.box_m(range);
  return {(box.min.x_m + box.max.x_m) / 2, (box.min.y_m + box.max.y_m) / 2};
}

Point vehicle_of(const SettingsReader& settings, const PatchSource& map) {
  return settings.point("vehicle").value_or(middle_of(map));
}

std::vector<SettingSpec> layout_settings() {
  return {
      {"layout",
       "A, B or C (non-uniform, 640 000 cells), moving, or sub-maps in a dense_array, hash_map, quadtree, "
       "sorted_vector or cow_tiles",
       "A", false, true},
      {"plan", "YAML file with rectangles of a non-uniform layout, in place of layout", "", false, true,
       true},
      {"vehicle", "X,Y of the vehicle, metres in the map's CRS", "the map's middle", false, true},
      {"cell_m", "side of a cell of moving and of sub-maps, metres", "the map's finest", false, true},
      {"half_extent_m", "moving: to each side of the vehicle, metres", "100", false, true},
      {"horizon_m", "sub-maps farther from the vehicle are left out, metres; 0: none", "0", false, true}};
}

void check_layout_settings(const SettingsReader& settings) {
  settings.choice("layout", kLayouts);
  if (settings.has("layout") && settings.has("plan")) settings.refuse("plan", "takes the place of layout");
  settings.point("vehicle");
  settings.number("cell_m", 1e-6, 1e4);
  settings.number("half_extent_m", 1e-6, 1e5);
  settings.number("horizon_m", 0, 1e6);
}

std::unique_ptr<Layout> choose_layout(const SettingsReader& settings, const PatchSource& map,
                                      std::uint64_t max_memory_bytes) {
  check_layout_settings(settings);
  const std::string name = settings.choice("layout", kLayouts).value_or("A");
  const Frame& frame = map.header().frame;
  CellSchema schema(map.header().types);
  const double cell_m = settings.number("cell_m").value_or(finest_cell_m(map));
  const auto check = [&](double cells) {
    // The cells, the same as layers, and what these are packed to, in a buffer that grows.
    const double bytes = 4 * cells * schema.values() * sizeof(float);
    check_budget(max_memory_bytes, static_cast<std::uint64_t>(std::min(bytes, 1e18)),
                 "a fixed layout is made in memory", "choose larger cells or crop the map");
  };
  std::unique_ptr<Layout> layout;
  if (settings.has("plan") || name.size() == 1) {
    NonUniformPlan plan = settings.has("plan") ? plan_from(*settings.text("plan")) : buerkle_preset(name);
    check(static_cast<double>(plan.cells()));
    layout = make_nonuniform_grid(std::move(schema), frame, std::move(plan));
  } else if (name == "moving") {
    const double half_m = settings.number("half_extent_m").value_or(kHalfExtent_m);
    check(4 * half_m * half_m / (cell_m * cell_m));
    layout = make_moving_grid(std::move(schema), frame, cell_m, half_m);
  } else {
    const double per_side = frame.edge_m() / cell_m;
    check(static_cast<double>(map.summary().patches) * per_side * per_side);
    layout = make_submap_grid(std::move(schema), frame, cell_m, submap_container_from(name).value(),
                              settings.number("horizon_m").value_or(0));
  }
  layout->move_to(vehicle_of(settings, map));
  return layout;
}

}  // namespace apgm::converters
