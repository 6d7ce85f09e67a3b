#include "tools/common/comparison.hpp"

#include <algorithm>
#include <cmath>

#include "apgm/core/budget.hpp"
#include "apgm/core/error.hpp"
#include "apgm/format/message.hpp"
#include "apgm/layouts/moving_grid.hpp"
#include "apgm/layouts/submap_grid.hpp"
#include "converters/common/choose.hpp"
#include "converters/common/file.hpp"
#include "converters/fixed_grid/layout_file.hpp"
#include "tools/common/layout_foreign.hpp"
#include "tools/common/layout_memory.hpp"
#include "tools/common/layout_travel.hpp"

namespace apgm::tools {
namespace {

constexpr std::uint64_t kSeed = 1;
constexpr double kMostBytes = 1e18;

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

void check_left(const CompareOptions& options, double need) {
  if (!options.memory_left) return;
  check_budget(options.memory_left(), static_cast<std::uint64_t>(std::min(need, kMostBytes)),
               "the memory budget does not hold the layouts",
               "choose a smaller --reach or cut a part out with apgm-crop");
}

}  // namespace

std::vector<NonUniformPlan> usual_plans() {
  return {buerkle_preset("A"), buerkle_preset("B"), buerkle_preset("C")};
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

void check_memory(const PatchSource& map, const CompareOptions& options) {
  if (!options.memory_left) return;
  const LayoutMemory memory(map.header().types, map.header().frame, options);
  check_left(options, map_bytes(map) + memory.travelling_bytes() + memory.row_bytes(map));
}

struct LayoutComparison::State {
  State(const Map& map, const CompareOptions& o)
      : options(o),
        schema(map.header().types),
        frame(map.header().frame),
        memory(schema.types(), frame, options) {
    const double cell_m = options.finest_cell_m;
    const double reach_m = std::ceil(options.reach_m / cell_m - 1e-9) * cell_m;
    check_left(options, memory.travelling_bytes() + memory.row_bytes(map));
    for (const NonUniformPlan& plan : options.plans) {
      travellers.emplace_back(make_nonuniform_grid(schema, frame, plan), options.cost);
    }
    travellers.emplace_back(make_moving_grid(schema, frame, cell_m, reach_m), options.cost);
  }

  void move_to(Point to, const Map* map) {
    vehicle = to;
    check_left(options, memory.shift_bytes());
    for (TravellingLayout& t : travellers) t.move_to(vehicle, map);
  }

  std::vector<LayoutRow> rows(const Map& map) {
    check_left(options, memory.row_bytes(map));
    std::vector<LayoutRow> rows{own_row(map)};
    for (TravellingLayout& t : travellers) {
      converters::check_cancelled(options.run);
      fill(t.layout(), map);
      rows.push_back(whole_row(t.layout(), map));
      const TravellingLayout::Shifts shifts = t.take_shifts();
      rows.back().shifts = shifts.count;
      if (rows.back().cost && shifts.count > 0) {
        rows.back().cost->shift_ns = shifts.spent_ns / static_cast<double>(shifts.count);
      }
    }
    add_submaps(map, rows);
    if (!options.disk || !options.foreign) return rows;
    for (LayoutRow& row : foreign_rows(map, options)) rows.push_back(std::move(row));
    return rows;
  }

 private:
  LayoutRow own_row(const Map& map) const {
    LayoutRow row;
    row.layout = "apgm";
    row.footprint = footprint(map);
    if (options.disk) row.disk_bytes = to_bytes(map).size();
    if (options.change) row.change = BeliefChange{.known_cells = row.footprint.known_cells};
    if (options.cost && row.footprint.cells > 0) row.cost = measure_cost(map, kSeed);
    return row;
  }

  LayoutRow row_in_memory(const Layout& layout) const {
    LayoutRow row;
    row.layout = layout.name();
    row.values_per_cell = schema.values();
    row.footprint = layout.footprint();
    if (options.cost && row.footprint.cells > 0) row.cost = measure_cost(layout, vehicle, kSeed);
    return row;
  }

  LayoutRow whole_row(const Layout& layout, const Map& map) const {
    LayoutRow row = row_in_memory(layout);
    if (options.disk) row.disk_bytes = converters::encode_layout(layout).size();
    if (options.change) row.change = change(layout, map);
    return row;
  }

  /// The containers of sub-maps hold the same cells: these are made once, and have one file and one change.
  void add_submaps(const Map& map, std::vector<LayoutRow>& rows) const {
    const auto made = [&](SubMapContainer container) {
      return make_submap_grid(schema, frame, options.finest_cell_m, container);
    };
    const auto first = made(SubMapContainer::kSortedVector);
    fill(*first, map);
    const LayoutRow of_first = whole_row(*first, map);
    for (const SubMapContainer container : kSubMapContainers) {
      converters::check_cancelled(options.run);
      LayoutRow row = of_first;
      if (container != SubMapContainer::kSortedVector) {
        const auto layout = made(container);
        try {
          copy_cells(*first, *layout);
          row = row_in_memory(*layout);
        } catch (const Error& error) {
          // A table of the whole extent, for patches that lie far apart.
          if (error.code() != ErrorCode::kLimit) throw;
          row.layout = layout->name();
          row.in_memory = false;
          row.cost.reset();
          row.note = error.message();
        }
        row.disk_bytes = of_first.disk_bytes;
        row.change = of_first.change;
      }
      rows.push_back(std::move(row));
    }
  }

  static std::optional<BeliefChange> change(const Layout& layout, const Map& map) {
    try {
      return belief_change(layout, map);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kIncompatible) throw;
      return {};
    }
  }

  CompareOptions options;
  CellSchema schema;
  Frame frame;
  std::vector<TravellingLayout> travellers;
  LayoutMemory memory;
  Point vehicle;
};

LayoutComparison::LayoutComparison(const Map& map, const CompareOptions& options)
    : state_(std::make_unique<State>(map, options)) {}
LayoutComparison::~LayoutComparison() = default;
void LayoutComparison::move_to(Point vehicle, const Map* map) { state_->move_to(vehicle, map); }
std::vector<LayoutRow> LayoutComparison::rows(const Map& map) { return state_->rows(map); }

std::vector<LayoutRow> compare_layouts(const Map& map, Point vehicle, const CompareOptions& options) {
  LayoutComparison comparison(map, options);
  comparison.move_to(vehicle, nullptr);
  return comparison.rows(map);
}

}  // namespace apgm::tools
