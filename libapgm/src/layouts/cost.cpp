#include "apgm/layouts/cost.hpp"

#include <algorithm>
#include <vector>

#include "apgm/core/error.hpp"
#include "layouts/cost_meter.hpp"

namespace apgm {
namespace {

using layouts::ReadBits;

class Meter {
 public:
  Meter(const Layout& layout, Point vehicle, std::uint64_t seed, const CostOptions& options)
      : layout_(layout), vehicle_(vehicle), options_(options), watch_(options) {
    layouts::CellDraws draws(seed);
    std::vector<CellBlock> blocks;
    layout.for_each_block([&](const CellBlock& block) {
      right_um_ = blocks.empty() ? block.area().x1_um : std::max(right_um_, block.area().x1_um);
      bottom_um_ = blocks.empty() ? block.area().y0_um : std::min(bottom_um_, block.area().y0_um);
      blocks.push_back(block);
      draws.add_part(static_cast<std::uint64_t>(block.columns) * static_cast<std::uint64_t>(block.rows));
    });
    cells_ = draws.count();
    if (cells_ == 0) throw Error(ErrorCode::kInvalidArgument, "the layout holds no cells to measure");
    for (int i = 0; i < options.accesses; ++i) {
      const auto [part, cell] = draws.draw();
      points_.push_back(centre(blocks[part], static_cast<std::int64_t>(cell)));
    }
  }

  LayoutCost run() {
    std::unique_ptr<Layout> copy;
    LayoutCost cost = layouts::time_accesses(watch_, options_,
                                             {[&] { copy = layout_.snapshot(); }, [&] { find(); },
                                              [&] { iterate(); }, [&] { insert(*copy); }, cells_});
    cost.grow_ns = grow(*copy);
    copy = layout_.snapshot();
    copy->move_to(vehicle_);
    cost.shift_ns = watch_.time_ns([&] { shift(*copy); }) / options_.shifts;
    return cost;
  }

 private:
  static Point centre(const CellBlock& block, std::int64_t cell) {
    const std::int64_t x = block.x_um + cell % block.columns * block.cell_x_um + block.cell_x_um / 2;
    const std::int64_t y = block.y_um + cell / block.columns * block.cell_y_um + block.cell_y_um / 2;
    return {static_cast<double>(x) / 1e6, static_cast<double>(y) / 1e6};
  }

  void find() const {
    ReadBits bits;
    for (const Point p : points_) {
      if (const float* cell = layout_.find(p)) bits.add(*cell);
    }
  }

  void insert(Layout& copy) const {
    const auto& values = layout_.schema().background();
    for (const Point p : points_) {
      if (float* cell = copy.insert(p)) std::copy(values.begin(), values.end(), cell);
    }
  }

  void iterate() const {
    ReadBits bits;
    layout_.for_each_block([&](const CellBlock& block) {
      for (int b = 0; b < block.rows; ++b) {
        const float* value = block.cells + b * block.row_stride;
        const float* end = value + std::int64_t{block.columns} * layout_.schema().values();
        for (; value != end; ++value) bits.add(*value);
      }
    });
  }

  /// One sub-map after the other to the right of all.
  double grow(Layout& copy) const {
    const std::int64_t edge = layout_.frame().edge_um;
    double total = 0;
    int grown = 0;
    for (int i = 0; i < options_.growths; ++i) {
      const Point p{static_cast<double>(right_um_ + i * edge + edge / 2) / 1e6,
                    static_cast<double>(bottom_um_) / 1e6};
      if (copy.find(p) != nullptr) continue;
      const float* made = nullptr;
      total += watch_.time_ns([&] { made = copy.insert(p); });
      grown += made != nullptr;
    }
    return grown == 0 ? 0 : total / grown;
  }

  void shift(Layout& copy) const {
    for (int i = 1; i <= options_.shifts; ++i) {
      copy.move_to({vehicle_.x_m + i * options_.step_m, vehicle_.y_m});
    }
  }

  const Layout& layout_;
  Point vehicle_;
  const CostOptions& options_;
  layouts::Stopwatch watch_;
  std::uint64_t cells_ = 0;
  std::int64_t right_um_ = 0, bottom_um_ = 0;
  std::vector<Point> points_;
};

}  // namespace

LayoutCost measure_cost(const Layout& layout, Point vehicle, std::uint64_t seed, const CostOptions& options) {
  return Meter(layout, vehicle, seed, options).run();
}

}  // namespace apgm
