#include <algorithm>

#include "layouts/cell_pool.hpp"
#include "layouts/rectangle_grid.hpp"

namespace apgm::layouts {

/// The cells that enter rectangles on a move, gathered from where the rectangles were. All are made before
/// the first is written: what enters one rectangle leaves another.
class RectangleGrid::Shift {
 public:
  Shift(RectangleGrid& grid, Offset to)
      : grid_(grid), to_(to), pool_(grid.schema_), values_(static_cast<std::size_t>(grid.schema_.values())) {
    extent_ = grid.area_now(grid.rectangles_.front());
    for (const Rectangle& r : grid.rectangles_) {
      const Area a = grid.area_now(r);
      extent_ = {std::min(extent_.x0_um, a.x0_um), std::min(extent_.y0_um, a.y0_um),
                 std::max(extent_.x1_um, a.x1_um), std::max(extent_.y1_um, a.y1_um)};
    }
  }

  void run() {
    for (const Rectangle& r : grid_.rectangles_) {
      visit_entering(r, [&](std::int64_t gx, std::int64_t gy) {
        entering_.resize(entering_.size() + values_);
        gather({gx * r.plan.dx, gy * r.plan.dy, (gx + 1) * r.plan.dx, (gy + 1) * r.plan.dy},
               entering_.data() + entering_.size() - values_);
      });
    }
    const float* next = entering_.data();
    for (const Rectangle& r : grid_.rectangles_) {
      visit_entering(r, [&](std::int64_t gx, std::int64_t gy) {
        std::copy_n(next, values_, const_cast<float*>(grid_.cell(grid_.cell_number(r, gx, gy))));
        next += values_;
      });
    }
    grid_.centre_ = to_;
  }

 private:
  /// visit(gx, gy) for the cells of `r` at the new place that it does not hold at the old one.
  template <class Visit>
  void visit_entering(const Rectangle& r, Visit&& visit) const {
    const Area old = grid_.area_now(r);
    const std::int64_t columns = r.plan.columns(), rows = r.plan.rows();
    const std::int64_t old_x = floor_div(old.x0_um, r.plan.dx), old_y = floor_div(old.y0_um, r.plan.dy);
    const std::int64_t new_x = floor_div(to_.x_um + r.plan.x0, r.plan.dx);
    const std::int64_t new_y = floor_div(to_.y_um + r.plan.y0, r.plan.dy);
    for (std::int64_t gy = new_y; gy < new_y + rows; ++gy) {
      const bool row_stays = gy >= old_y && gy < old_y + rows;
      for (std::int64_t gx = new_x; gx < new_x + columns; ++gx) {
        if (row_stays && gx >= old_x && gx < old_x + columns) {
          gx = old_x + columns - 1;
          continue;
        }
        visit(gx, gy);
      }
    }
  }

  /// The cell `target`, from the datum, of the cells at the old place.
  void gather(const Area& target, float* out) {
    std::copy(grid_.schema_.background().begin(), grid_.schema_.background().end(), out);
    if (!extent_.meets(target)) return;
    pool_.clear();
    const double target_area = area_of(target);
    for (const Rectangle& r : grid_.rectangles_) {
      const Area shared = grid_.area_now(r).shared(target);
      if (shared.empty()) continue;
      const double source_area = static_cast<double>(r.plan.dx) * static_cast<double>(r.plan.dy);
      for (std::int64_t gy = floor_div(shared.y0_um, r.plan.dy); gy * r.plan.dy < shared.y1_um; ++gy) {
        for (std::int64_t gx = floor_div(shared.x0_um, r.plan.dx); gx * r.plan.dx < shared.x1_um; ++gx) {
          const float* from = grid_.cell(grid_.cell_number(r, gx, gy));
          const Area source{gx * r.plan.dx, gy * r.plan.dy, (gx + 1) * r.plan.dx, (gy + 1) * r.plan.dy};
          if (source == target) {
            // The same square: its bits are the answer.
            std::copy_n(from, values_, out);
            return;
          }
          if (!grid_.schema_.is_known(from)) continue;
          const double part = area_of(source.shared(target));
          pool_.add(from, part / source_area, part / target_area);
        }
      }
    }
    pool_.restore(out);
  }

  static double area_of(const Area& a) {
    return static_cast<double>(a.x1_um - a.x0_um) * static_cast<double>(a.y1_um - a.y0_um);
  }

  RectangleGrid& grid_;
  Offset to_;
  CellPool pool_;
  std::size_t values_;
  Area extent_;
  std::vector<float> entering_;
};

void RectangleGrid::move_to(Point vehicle) {
  const Offset to = snapped(vehicle);
  if (to != centre_) Shift(*this, to).run();
}

}  // namespace apgm::layouts
