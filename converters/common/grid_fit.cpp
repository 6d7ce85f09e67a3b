#include "converters/common/grid_fit.hpp"

#include <cmath>
#include <limits>

#include "apgm/core/working_memory.hpp"
#include "apgm/fuse/regrid.hpp"

namespace apgm::converters {
namespace {

constexpr double kPaperEdge_m = 12.8;
constexpr double kEqual = 1e-9;  // relative: sizes closer than this are the same size

void note(const Findings& findings, std::string text) {
  if (findings) findings({Finding::Kind::kNote, std::move(text)});
}

int nearest_step(double cell_m) {
  int best = 0;
  for (int step = 1; step <= kMaxStep; ++step) {
    const auto distance = [&](int r) { return std::fabs(std::ldexp(cell_m, r) - kPaperEdge_m); };
    if (distance(step) < distance(best)) best = step;
  }
  return best;
}

std::optional<int> step_of_edge(double cell_m, double edge_m) {
  for (int step = 0; step <= kMaxStep; ++step) {
    if (std::fabs(std::ldexp(cell_m, step) - edge_m) <= kEqual * edge_m) return step;
  }
  return {};
}

std::int64_t micrometres(double metres, const char* what, const Findings& findings) {
  const std::int64_t um = to_micrometres(metres);
  const double lost_m = metres - static_cast<double>(um) * 1e-6;
  if (std::fabs(lost_m) > 1e-9 && std::fabs(lost_m) > kEqual * std::fabs(metres)) {
    note(findings, std::string(what) + " " + format_number(metres) + " m is kept as " +
                       format_number(static_cast<double>(um) / 1e6) + " m, the nearest micrometre");
  }
  return um;
}

/// Cells from `from` to `to`; nullopt if that is no whole number.
std::optional<std::int64_t> cells_between(std::int64_t from_um, std::int64_t to_um, std::int64_t edge_um,
                                          int step) {
  const __int128 scaled = (static_cast<__int128>(to_um) - from_um) << step;
  if (scaled % edge_um != 0) return {};
  return static_cast<std::int64_t>(scaled / edge_um);
}

/// A regridded source together with the one it reads.
class OwningSource final : public PatchSource, public WorkingMemory {
 public:
  OwningSource(std::unique_ptr<PatchSource> native, const Frame& target, const RigidMotion& motion,
               RegridBudget& budget)
      : native_(std::move(native)), seen_(regrid(*native_, target, motion, {}, &budget)) {}
  const MapHeader& header() const override { return seen_->header(); }
  Summary summary() const override { return seen_->summary(); }
  std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>& range) const override {
    return seen_->patches(range);
  }
  void load(const LayerInfo& info, Layer& out) const override { seen_->load(info, out); }
  std::uint64_t working_bytes(std::uint64_t layer_bytes) const override {
    return apgm::working_bytes(*seen_, layer_bytes);
  }

 private:
  std::unique_ptr<PatchSource> native_;
  std::unique_ptr<PatchSource> seen_;
};

}  // namespace

Frame::Cell GridFit::cell_at(std::int64_t i, std::int64_t j) const {
  const std::int64_t x = i + offset_x, y = j + offset_y;
  const auto patch_index = [](std::int64_t p) {
    if (p < std::numeric_limits<std::int32_t>::min() || p > std::numeric_limits<std::int32_t>::max()) {
      throw Error(ErrorCode::kLimit, "the map lies outside all patch indices")
          .hint("choose a datum nearer to the map, or a larger edge_m");
    }
    return static_cast<std::int32_t>(p);
  };
  const std::int64_t last = (std::int64_t{1} << step) - 1;
  return {{patch_index(x >> step), patch_index(y >> step)},
          {static_cast<std::int32_t>(x & last), static_cast<std::int32_t>(y & last)}};
}

GridFit fit_grid(const ForeignGrid& grid, const SettingsReader& settings, const Findings& findings) {
  const auto edge_m = settings.number("edge_m", 1e-3, 1e4);
  const auto datum = settings.point("datum");

  GridFit fit;
  const auto fitting = edge_m ? step_of_edge(grid.cell_m, *edge_m) : std::optional<int>();
  fit.step = fitting ? *fitting : nearest_step(grid.cell_m);
  fit.native.edge_um = micrometres(std::ldexp(grid.cell_m, fit.step), "the patch edge", findings);
  fit.native.datum_x_um = micrometres(grid.origin_m.x_m, "the origin x", findings);
  fit.native.datum_y_um = micrometres(grid.origin_m.y_m, "the origin y", findings);
  read_names(settings, fit.native);
  fit.native.check();

  Frame wanted = fit.native;
  if (edge_m && !fitting) wanted.edge_um = to_micrometres(*edge_m);
  if (datum) {
    wanted.datum_x_um = to_micrometres(datum->x_m);
    wanted.datum_y_um = to_micrometres(datum->y_m);
  }
  wanted.check();
  if (wanted == fit.native && grid.yaw_rad == 0) return fit;

  const Frame& n = fit.native;
  const auto x = cells_between(wanted.datum_x_um, n.datum_x_um, n.edge_um, fit.step);
  const auto y = cells_between(wanted.datum_y_um, n.datum_y_um, n.edge_um, fit.step);
  if (grid.yaw_rad == 0 && wanted.edge_um == n.edge_um && x && y) {
    fit.native = wanted;
    fit.offset_x = *x;
    fit.offset_y = *y;
  } else {
    fit.target = wanted;
  }
  return fit;
}

std::unique_ptr<PatchSource> place(std::unique_ptr<PatchSource> native, const ForeignGrid& grid,
                                   const GridFit& fit, const Findings& findings,
                                   std::uint64_t max_memory_bytes) {
  if (!fit.target) return native;
  if (findings && native->summary().patches > 0) {
    findings({Finding::Kind::kLoss,
              grid.yaw_rad != 0
                  ? "the map is turned: its cells are regridded by area weights"
                  : "edge_m or datum is not on whole cells: the cells are regridded by area weights"});
  }
  RigidMotion motion;
  motion.yaw_rad = grid.yaw_rad;
  motion.pivot_m = fit.native.datum_m();
  RegridBudget budget{max_memory_bytes};
  return std::make_unique<OwningSource>(std::move(native), *fit.target, motion, budget);
}

}  // namespace apgm::converters
