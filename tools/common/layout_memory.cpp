#include "tools/common/layout_memory.hpp"

#include <algorithm>
#include <cmath>

namespace apgm::tools {
namespace {

constexpr double kTileSide = 128;
/// Of a patch, a layer or a tile: nodes, headers of the allocator, what a file says of it.
constexpr double kAround = 1024;
/// Places that are accessed when times are measured, lists of blocks, buffers.
constexpr double kLists = 4 << 20;

double padded(double cells) { return std::ceil(cells / kTileSide) * kTileSide; }

/// Of a layout on its way to a file: its cells once more, and what they are packed to, in a buffer that
/// grows.
double file_bytes(double cell_bytes) { return 3 * cell_bytes; }

/// All values of all types at one cell size.
double dense_bytes(const PatchSource& map, double cell_m, int values) {
  const double per_side = map.header().frame.edge_m() / cell_m;
  return static_cast<double>(map.summary().patches) *
         (per_side * per_side * values * sizeof(float) + kAround);
}

}  // namespace

double map_bytes(const PatchSource& map) {
  double bytes = 0;
  for (const Summary::OfType& type : map.summary().types) {
    bytes += static_cast<double>(type.raw_bytes) + kAround * static_cast<double>(type.layers);
  }
  return bytes;
}

LayoutMemory::LayoutMemory(const TypeTable& types, const Frame& frame, const CompareOptions& options)
    : options_(options), values_(CellSchema(types).values()), frame_(frame) {
  for (const NonUniformPlan& plan : options.plans) {
    double in_file = 0;
    for (const LayoutRectangle& r : plan.rectangles) {
      in_file += padded((r.x1_m - r.x0_m) / r.dx_m) * padded((r.y1_m - r.y0_m) / r.dy_m);
    }
    add_grid(static_cast<double>(plan.cells()), in_file);
  }
  const double side = 2 * std::ceil(options.reach_m / options.finest_cell_m);
  add_grid(side * side, padded(side) * padded(side));
}

void LayoutMemory::add_grid(double cells, double cells_in_file) {
  const double cell_bytes = values_ * static_cast<double>(sizeof(float));
  travelling_ += cells * cell_bytes;
  largest_ = std::max(largest_, cells * cell_bytes);
  largest_file_ = std::max(largest_file_, cells_in_file * cell_bytes);
}

double LayoutMemory::work_bytes() const {
  const double per_side = frame_.edge_m() / options_.finest_cell_m;
  return 4 * per_side * per_side * values_ * static_cast<double>(sizeof(float)) + kLists;
}

double LayoutMemory::back_bytes(const PatchSource& map, double finest_cell_m) {
  return dense_bytes(map, finest_cell_m, CellSchema(map.header().types).values());
}

double LayoutMemory::row_bytes(const PatchSource& map) const {
  const double submaps = dense_bytes(map, options_.finest_cell_m, values_);
  double most = shift_bytes();
  if (options_.disk) most = std::max({most, 2 * map_bytes(map), file_bytes(largest_file_)});
  // Sub-maps in one container, then in a second one beside it.
  most = std::max(most, submaps + (options_.disk ? file_bytes(submaps) : submaps));
  if (options_.cost) most = std::max({most, map_bytes(map), largest_, 3 * submaps});
  return most + work_bytes();
}

}  // namespace apgm::tools
