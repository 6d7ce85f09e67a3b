#include <algorithm>
#include <array>
#include <bit>
#include <set>

#include "apgm/core/error.hpp"
#include "apgm/layouts/nonuniform_grid.hpp"
#include "layouts/rectangle_grid.hpp"

namespace apgm {
namespace {

using layouts::PlannedRectangle;

std::string rectangle(std::size_t i) { return "rectangle " + std::to_string(i + 1); }

[[noreturn]] void refuse(const std::string& what, const std::string& hint) {
  throw Error(ErrorCode::kInvalidArgument, what).hint(hint);
}

PlannedRectangle planned(const LayoutRectangle& r, const std::string& what) {
  PlannedRectangle p;
  p.x0 = layouts::whole_um(r.x0_m, what + ": x0");
  p.x1 = layouts::whole_um(r.x1_m, what + ": x1");
  p.y0 = layouts::whole_um(r.y0_m, what + ": y0");
  p.y1 = layouts::whole_um(r.y1_m, what + ": y1");
  p.dx = layouts::whole_um(r.dx_m, what + ": the width of a cell");
  p.dy = layouts::whole_um(r.dy_m, what + ": the height of a cell");
  if (p.x1 <= p.x0 || p.y1 <= p.y0) refuse(what + " is empty or inverted", "give the lesser bound first");
  if (p.dx <= 0 || p.dy <= 0) refuse(what + " has cells without area", "sides of cells are above 0");
  if (p.x0 % p.dx != 0 || p.x1 % p.dx != 0 || p.y0 % p.dy != 0 || p.y1 % p.dy != 0) {
    refuse(what + " does not begin and end at multiples of its cells",
           "bounds are multiples of the cell's side, counted from the vehicle");
  }
  return p;
}

void check_sides(const std::vector<PlannedRectangle>& all) {
  std::int64_t least = all.front().dx;
  for (const PlannedRectangle& r : all) least = std::min({least, r.dx, r.dy});
  for (std::size_t i = 0; i < all.size(); ++i) {
    for (const std::int64_t side : {all[i].dx, all[i].dy}) {
      const auto ratio = static_cast<std::uint64_t>(side / least);
      if (side % least != 0 || !std::has_single_bit(ratio) || ratio > (std::uint64_t{1} << kMaxStep)) {
        refuse(rectangle(i) + " has cells whose side is not the least side times a power of two",
               "for example 0.1, 0.2 and 0.4");
      }
    }
  }
}

void check_overlaps(const std::vector<PlannedRectangle>& all) {
  for (std::size_t i = 0; i < all.size(); ++i) {
    for (std::size_t k = i + 1; k < all.size(); ++k) {
      if (all[i].area().meets(all[k].area())) {
        refuse("rectangles " + std::to_string(i + 1) + " and " + std::to_string(k + 1) + " overlap",
               "each place belongs to one rectangle");
      }
    }
  }
}

/// The edges cut the bounding box into a raster that rectangles cover by whole cells.
void check_gaps(const std::vector<PlannedRectangle>& all) {
  std::set<std::int64_t> xs, ys;
  for (const PlannedRectangle& r : all) {
    xs.insert({r.x0, r.x1});
    ys.insert({r.y0, r.y1});
  }
  for (auto y = ys.begin(); std::next(y) != ys.end(); ++y) {
    for (auto x = xs.begin(); std::next(x) != xs.end(); ++x) {
      const Area cell{*x, *y, *x + 1, *y + 1};
      if (std::ranges::any_of(all, [&](const PlannedRectangle& r) { return r.area().meets(cell); })) continue;
      const auto metres = [](std::int64_t um) {
        std::string text = std::to_string(static_cast<double>(um) / 1e6);
        text.erase(text.find_last_not_of('0') + 1);
        if (text.back() == '.') text.pop_back();
        return text;
      };
      refuse("the rectangles leave a gap at x " + metres(*x) + " to " + metres(*std::next(x)) + " m, y " +
                 metres(*y) + " to " + metres(*std::next(y)) + " m",
             "the rectangles together fill their bounding box");
    }
  }
}

LayoutRectangle part(double x0, double x1, double y0, double y1, double dx, double dy) {
  return {x0, x1, y0, y1, dx, dy};
}

/// The ring between two squares: below, left, right, above.
void add_ring(NonUniformPlan& plan, double inner, double outer, double cell) {
  plan.rectangles.push_back(part(-outer, outer, -outer, -inner, cell, cell));
  plan.rectangles.push_back(part(-outer, -inner, -inner, inner, cell, cell));
  plan.rectangles.push_back(part(inner, outer, -inner, inner, cell, cell));
  plan.rectangles.push_back(part(-outer, outer, inner, outer, cell, cell));
}

/// 3 x 3 blocks of +-20 m and +-100 m. `sides(i, k)`: of the cells in the block of column i and row k.
template <class Sides>
void add_blocks(NonUniformPlan& plan, Sides&& sides) {
  constexpr std::array kEdges{-100.0, -20.0, 20.0, 100.0};
  for (std::size_t k = 0; k < 3; ++k) {
    for (std::size_t i = 0; i < 3; ++i) {
      const auto [dx, dy] = sides(i, k);
      plan.rectangles.push_back(part(kEdges[i], kEdges[i + 1], kEdges[k], kEdges[k + 1], dx, dy));
    }
  }
}

}  // namespace

std::vector<PlannedRectangle> layouts::checked_rectangles(const NonUniformPlan& plan) {
  if (plan.rectangles.empty()) refuse("the layout has no rectangles", "give at least one");
  if (plan.rectangles.size() > NonUniformPlan::kMaxRectangles) {
    throw Error(ErrorCode::kLimit, "the layout has more than 256 rectangles");
  }
  std::vector<PlannedRectangle> all;
  for (std::size_t i = 0; i < plan.rectangles.size(); ++i) {
    all.push_back(planned(plan.rectangles[i], rectangle(i)));
  }
  check_sides(all);
  check_overlaps(all);
  check_gaps(all);
  // A side has at most 2e12 cells; products of two do not fit 63 bits.
  unsigned __int128 cells = 0;
  for (const PlannedRectangle& r : all) {
    cells += static_cast<unsigned __int128>(r.columns()) * static_cast<unsigned __int128>(r.rows());
  }
  if (cells > NonUniformPlan::kMaxCells) {
    throw Error(ErrorCode::kLimit, "the layout has more than 2^28 cells").hint("choose larger cells");
  }
  return all;
}

void NonUniformPlan::check() const { layouts::checked_rectangles(*this); }

std::uint64_t NonUniformPlan::cells() const {
  std::uint64_t cells = 0;
  for (const PlannedRectangle& r : layouts::checked_rectangles(*this)) {
    cells += static_cast<std::uint64_t>(r.columns()) * static_cast<std::uint64_t>(r.rows());
  }
  return cells;
}

NonUniformPlan buerkle_preset(std::string_view name) {
  NonUniformPlan plan;
  plan.name = name;
  if (name == "A") {
    plan.rectangles.push_back(part(-20, 20, -20, 20, 0.1, 0.1));
    add_ring(plan, 20, 60, 0.2);
    add_ring(plan, 60, 100, 0.4);
  } else if (name == "B") {
    add_blocks(plan, [](std::size_t i, std::size_t k) {
      const double side = i == 1 && k == 1 ? 0.1 : i == 1 || k == 1 ? 0.2 : 0.4;
      return std::pair(side, side);
    });
  } else if (name == "C") {
    add_blocks(
        plan, [](std::size_t i, std::size_t k) { return std::pair(i == 1 ? 0.1 : 0.4, k == 1 ? 0.1 : 0.4); });
  } else {
    refuse("there is no Buerkle layout '" + plan.name + "'", "A, B or C, or rectangles of your own in YAML");
  }
  return plan;
}

}  // namespace apgm
