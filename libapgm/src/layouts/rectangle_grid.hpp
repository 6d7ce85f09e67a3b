#pragma once

#include <memory>
#include <string>
#include <vector>

#include "apgm/layouts/description.hpp"
#include "layouts/geometry.hpp"

namespace apgm::layouts {

/// A rectangle in micrometres from the vehicle's snapped position.
struct PlannedRectangle {
  std::int64_t x0 = 0, x1 = 0, y0 = 0, y1 = 0;
  std::int64_t dx = 0, dy = 0;

  std::int64_t columns() const { return (x1 - x0) / dx; }
  std::int64_t rows() const { return (y1 - y0) / dy; }
  Area area() const { return {x0, y0, x1, y1}; }
};

/// The rectangles of a plan. @throws those of NonUniformPlan::check
std::vector<PlannedRectangle> checked_rectangles(const NonUniformPlan& plan);

/// Rectangles of cells that move with the vehicle. Each is a ring buffer on both axes: the cell that lies
/// `gx` cells from the datum is in column `gx mod columns` wherever the vehicle is, so that cells that stay
/// are not touched by a move.
class RectangleGrid final : public Layout {
 public:
  RectangleGrid(CellSchema schema, const Frame& frame, std::string name, const NonUniformPlan& plan);
  /// @param vehicle  a multiple of the coarsest side. @throws Error{kInvalidArgument} if it is none
  void place_at(Offset vehicle);

  std::string name() const override { return name_; }
  const CellSchema& schema() const override { return schema_; }
  const Frame& frame() const override { return frame_; }
  void move_to(Point vehicle) override;
  const float* find(Point p) const override;
  float* insert(Point p) override { return const_cast<float*>(find(p)); }
  void reserve(const Area&) override {}
  void for_each_block(const std::function<void(const CellBlock&)>& visit) const override;
  void edit_blocks(const Area& area, const std::function<void(const CellBlock&, float*)>& visit) override;
  std::unique_ptr<Layout> snapshot() const override { return std::make_unique<RectangleGrid>(*this); }
  Footprint footprint() const override;
  LayoutDescription describe() const override;

 private:
  class Shift;
  struct Rectangle {
    PlannedRectangle plan;
    std::int64_t first = 0;  // its first cell, in cells
  };

  Offset snapped(Point vehicle) const;
  /// Where a rectangle is now, from the datum.
  Area area_now(const Rectangle& r) const;
  std::int64_t cell_number(const Rectangle& r, std::int64_t gx, std::int64_t gy) const {
    return r.first + floor_mod(gy, r.plan.rows()) * r.plan.columns() + floor_mod(gx, r.plan.columns());
  }
  const float* cell(std::int64_t number) const { return cells_.data() + number * schema_.values(); }

  CellSchema schema_;
  Frame frame_;
  std::string name_;
  std::vector<Rectangle> rectangles_;
  std::vector<float> cells_;
  std::int64_t coarsest_um_ = 0;
  Offset centre_;
};

}  // namespace apgm::layouts
