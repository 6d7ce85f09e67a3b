#include "tools/common/comparison.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include "apgm/core/error.hpp"
#include "apgm/format/message.hpp"
#include "apgm/layouts/moving_grid.hpp"
#include "apgm/layouts/submap_grid.hpp"
#include "converters/fixed_grid/layout_file.hpp"

namespace apgm::tools {
namespace {

constexpr std::uint64_t kSeed = 1;

/// Between layouts of the same blocks.
void copy_cells(const Layout& from, Layout& to) {
  const int values = from.schema().values();
  from.for_each_block([&](const CellBlock& block) {
    to.reserve(block.area());
    to.edit_blocks(block.area(), [&](const CellBlock& same, float* cells) {
      for (int b = 0; b < block.rows; ++b) {
        std::copy_n(block.cells + b * block.row_stride, std::int64_t{block.columns} * values,
                    cells + b * same.row_stride);
      }
    });
  });
}

class Comparer {
 public:
  Comparer(const Map& map, Point vehicle, const CompareOptions& options)
      : map_(map), vehicle_(vehicle), options_(options), schema_(map.header().types) {}

  LayoutRow own_row() const {
    LayoutRow row;
    row.layout = "apgm";
    row.footprint = footprint(map_);
    if (options_.disk) row.disk_bytes = to_bytes(map_).size();
    if (options_.change) row.change = BeliefChange{.known_cells = row.footprint.known_cells};
    if (options_.cost && row.footprint.cells > 0) row.cost = measure_cost(map_, kSeed);
    return row;
  }

  LayoutRow row(std::unique_ptr<Layout> layout) const {
    layout->move_to(vehicle_);
    fill(*layout, map_);
    LayoutRow row = measured(*layout);
    if (options_.disk) row.disk_bytes = converters::encode_layout(*layout).size();
    if (options_.change) row.change = change(*layout);
    return row;
  }

  /// The containers of sub-maps hold the same cells: they are made once, and have one file and one change.
  void add_submaps(double cell_m, std::vector<LayoutRow>& rows) const {
    std::unique_ptr<Layout> first;
    for (const SubMapContainer container : kSubMapContainers) {
      auto layout = make_submap_grid(schema_, map_.header().frame, cell_m, container);
      if (first == nullptr) {
        fill(*layout, map_);
        rows.push_back(measured(*layout));
        if (options_.disk) rows.back().disk_bytes = converters::encode_layout(*layout).size();
        if (options_.change) rows.back().change = change(*layout);
        first = std::move(layout);
        continue;
      }
      copy_cells(*first, *layout);
      LayoutRow row = measured(*layout);
      row.disk_bytes = rows.back().disk_bytes;
      row.change = rows.back().change;
      rows.push_back(std::move(row));
    }
  }

  const CellSchema& schema() const { return schema_; }

 private:
  LayoutRow measured(const Layout& layout) const {
    LayoutRow row;
    row.layout = layout.name();
    row.values_per_cell = schema_.values();
    row.footprint = layout.footprint();
    if (options_.cost && row.footprint.cells > 0) row.cost = measure_cost(layout, vehicle_, kSeed);
    return row;
  }

  std::optional<BeliefChange> change(const Layout& layout) const {
    try {
      return belief_change(layout, map_);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kIncompatible) throw;
      return {};
    }
  }

  const Map& map_;
  Point vehicle_;
  const CompareOptions& options_;
  CellSchema schema_;
};

}  // namespace

std::vector<NonUniformPlan> usual_plans() {
  return {buerkle_preset("A"), buerkle_preset("B"), buerkle_preset("C")};
}

double finest_cell_m(const Map& map) {
  int finest = -1;
  for (const auto& [key, patch] : map.by_key()) {
    for (const auto& [type, layer] : patch.layers) finest = std::max(finest, layer.step());
  }
  if (finest < 0) throw Error(ErrorCode::kInvalidArgument, "the map holds no layers to compare");
  return map.header().frame.cell_m(finest);
}

double finest_cell_m(const Schedule& schedule, const Frame& frame) {
  int finest = 0;
  for (const Schedule::Entry& entry : schedule.entries) {
    for (const Requirement& r : entry.profile.requirements)
      finest = std::max(finest, frame.step_for(r.cell_m));
  }
  return frame.cell_m(finest);
}

std::optional<double> farthest_m(const Schedule& schedule) {
  std::optional<double> most;
  for (const Schedule::Entry& entry : schedule.entries) {
    for (const Requirement& r : entry.profile.requirements) {
      if (const auto* ring = std::get_if<Ring>(&r.area)) most = std::max(most.value_or(0), ring->to_m);
    }
  }
  return most;
}

std::vector<LayoutRow> compare_layouts(const Map& map, Point vehicle, const CompareOptions& options) {
  const Comparer comparer(map, vehicle, options);
  const Frame& frame = map.header().frame;
  std::vector<LayoutRow> rows{comparer.own_row()};
  for (const NonUniformPlan& plan : options.plans) {
    rows.push_back(comparer.row(make_nonuniform_grid(comparer.schema(), frame, plan)));
  }
  const double cell_m = options.finest_cell_m;
  const double reach_m = std::ceil(options.reach_m / cell_m - 1e-9) * cell_m;
  rows.push_back(comparer.row(make_moving_grid(comparer.schema(), frame, cell_m, reach_m)));
  comparer.add_submaps(cell_m, rows);
  return rows;
}

}  // namespace apgm::tools
