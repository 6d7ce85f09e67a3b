#include "layouts/rectangle_grid.hpp"

#include <algorithm>

#include "apgm/core/error.hpp"
#include "apgm/layouts/moving_grid.hpp"
#include "layouts/allocation.hpp"

namespace apgm {
namespace layouts {
namespace {

constexpr std::uint64_t kMaxBytes = std::uint64_t{8} << 30;

}  // namespace

RectangleGrid::RectangleGrid(CellSchema schema, const Frame& frame, std::string name,
                             const NonUniformPlan& plan)
    : schema_(std::move(schema)), frame_(frame), name_(std::move(name)) {
  frame_.check();
  const auto planned = checked_rectangles(plan);
  rectangles_.reserve(planned.size());
  std::int64_t cells = 0;
  for (const PlannedRectangle& r : planned) {
    rectangles_.push_back({r, cells});
    cells += r.columns() * r.rows();
    coarsest_um_ = std::max({coarsest_um_, r.dx, r.dy});
  }
  const auto values = static_cast<std::uint64_t>(schema_.values());
  if (static_cast<std::uint64_t>(cells) > kMaxBytes / sizeof(float) / values) {
    throw Error(ErrorCode::kLimit, "the layout would take more than 8 GiB").hint("choose larger cells");
  }
  cells_.reserve(static_cast<std::size_t>(cells) * values);
  for (std::int64_t i = 0; i < cells; ++i) {
    cells_.insert(cells_.end(), schema_.background().begin(), schema_.background().end());
  }
}

Offset RectangleGrid::snapped(Point vehicle) const {
  const Offset at = offset_of(frame_, vehicle);
  const auto nearest = [&](std::int64_t um) {
    return floor_div(um + coarsest_um_ / 2, coarsest_um_) * coarsest_um_;
  };
  return {nearest(at.x_um), nearest(at.y_um)};
}

Area RectangleGrid::area_now(const Rectangle& r) const {
  return {centre_.x_um + r.plan.x0, centre_.y_um + r.plan.y0, centre_.x_um + r.plan.x1,
          centre_.y_um + r.plan.y1};
}

const float* RectangleGrid::find(Point p) const {
  const Offset at = offset_of(frame_, p);
  const std::int64_t x = at.x_um - centre_.x_um, y = at.y_um - centre_.y_um;
  for (const Rectangle& r : rectangles_) {
    if (x < r.plan.x0 || x >= r.plan.x1 || y < r.plan.y0 || y >= r.plan.y1) continue;
    return cell(cell_number(r, floor_div(at.x_um, r.plan.dx), floor_div(at.y_um, r.plan.dy)));
  }
  return nullptr;
}

void RectangleGrid::for_each_block(const std::function<void(const CellBlock&)>& visit) const {
  for (const Rectangle& r : rectangles_) {
    const Area area = area_now(r);
    const std::int64_t columns = r.plan.columns(), rows = r.plan.rows();
    const std::int64_t gx = floor_div(area.x0_um, r.plan.dx), gy = floor_div(area.y0_um, r.plan.dy);
    // Up to the end of the buffer, and from its start on.
    const std::int64_t columns_to_end = columns - floor_mod(gx, columns);
    const std::int64_t rows_to_end = rows - floor_mod(gy, rows);
    CellBlock block;
    block.cell_x_um = r.plan.dx;
    block.cell_y_um = r.plan.dy;
    block.row_stride = columns * schema_.values();
    for (const std::int64_t b : {std::int64_t{0}, rows_to_end}) {
      block.rows = static_cast<int>(b == 0 ? rows_to_end : rows - rows_to_end);
      for (const std::int64_t a : {std::int64_t{0}, columns_to_end}) {
        block.columns = static_cast<int>(a == 0 ? columns_to_end : columns - columns_to_end);
        if (block.rows == 0 || block.columns == 0) continue;
        block.x_um = frame_.datum_x_um + area.x0_um + a * r.plan.dx;
        block.y_um = frame_.datum_y_um + area.y0_um + b * r.plan.dy;
        block.cells = cell(cell_number(r, gx + a, gy + b));
        visit(block);
      }
    }
  }
}

void RectangleGrid::edit_blocks(const Area& area,
                                const std::function<void(const CellBlock&, float*)>& visit) {
  for_each_block([&](const CellBlock& block) {
    if (block.area().meets(area)) visit(block, const_cast<float*>(block.cells));
  });
}

void RectangleGrid::place_at(Offset vehicle) {
  constexpr std::int64_t kFarthest = 4'000'000'000'000'000;
  if (std::max({vehicle.x_um, vehicle.y_um, -vehicle.x_um, -vehicle.y_um}) > kFarthest ||
      vehicle.x_um % coarsest_um_ != 0 || vehicle.y_um % coarsest_um_ != 0) {
    throw Error(ErrorCode::kInvalidArgument, "a layout stands at a multiple of its coarsest cell");
  }
  centre_ = vehicle;
}

LayoutDescription RectangleGrid::describe() const {
  LayoutDescription d;
  d.name = name_;
  d.frame = frame_;
  const auto metres = [](std::int64_t um) { return static_cast<double>(um) / 1e6; };
  for (const Rectangle& r : rectangles_) {
    d.rectangles.push_back({metres(r.plan.x0), metres(r.plan.x1), metres(r.plan.y0), metres(r.plan.y1),
                            metres(r.plan.dx), metres(r.plan.dy)});
  }
  d.vehicle_x_um = centre_.x_um;
  d.vehicle_y_um = centre_.y_um;
  return d;
}

Footprint RectangleGrid::footprint() const {
  Footprint f = count_cells(*this);
  f.allocated_bytes =
      heap_bytes(cells_.capacity() * sizeof(float)) + heap_bytes(rectangles_.capacity() * sizeof(Rectangle));
  return f;
}

}  // namespace layouts

std::unique_ptr<Layout> make_nonuniform_grid(CellSchema schema, const Frame& frame, NonUniformPlan plan) {
  std::string name = "buerkle-" + plan.name;
  return std::make_unique<layouts::RectangleGrid>(std::move(schema), frame, std::move(name), plan);
}

std::unique_ptr<Layout> make_layout(CellSchema schema, const LayoutDescription& d) {
  if (!d.moves()) return make_submap_grid(std::move(schema), d.frame, d.cell_m, d.container, d.horizon_m);
  auto grid = std::make_unique<layouts::RectangleGrid>(std::move(schema), d.frame, d.name,
                                                       NonUniformPlan{d.name, d.rectangles});
  grid->place_at({d.vehicle_x_um, d.vehicle_y_um});
  return grid;
}

std::unique_ptr<Layout> make_moving_grid(CellSchema schema, const Frame& frame, double cell_m,
                                         double half_extent_m) {
  const std::int64_t cell = layouts::whole_um(cell_m, "the side of a cell");
  const std::int64_t half = layouts::whole_um(half_extent_m, "the half extent");
  if (cell <= 0 || half <= 0 || half % cell != 0) {
    throw Error(ErrorCode::kInvalidArgument, "the half extent is not a whole number of cells");
  }
  NonUniformPlan plan;
  plan.rectangles.push_back({-half_extent_m, half_extent_m, -half_extent_m, half_extent_m, cell_m, cell_m});
  return std::make_unique<layouts::RectangleGrid>(std::move(schema), frame, "moving", plan);
}

}  // namespace apgm
