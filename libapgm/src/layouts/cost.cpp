#include "apgm/layouts/cost.hpp"

#include <algorithm>
#include <bit>
#include <chrono>
#include <vector>

#include "apgm/core/error.hpp"

namespace apgm {
namespace {

/// splitmix64: the same draws on every platform.
class Draws {
 public:
  explicit Draws(std::uint64_t seed) : state_(seed) {}
  std::uint64_t below(std::uint64_t n) {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (z ^ (z >> 31)) % n;
  }

 private:
  std::uint64_t state_;
};

std::int64_t steady_now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

struct Cells {
  std::vector<CellBlock> blocks;
  std::vector<std::uint64_t> first;  // number of a block's first cell
  std::uint64_t count = 0;
  Area extent;
};

Cells cells_of(const Layout& layout) {
  Cells cells;
  layout.for_each_block([&](const CellBlock& block) {
    const Area a = block.area();
    Area& e = cells.extent;
    e = cells.blocks.empty() ? a
                             : Area{std::min(e.x0_um, a.x0_um), std::min(e.y0_um, a.y0_um),
                                    std::max(e.x1_um, a.x1_um), std::max(e.y1_um, a.y1_um)};
    cells.blocks.push_back(block);
    cells.first.push_back(cells.count);
    cells.count += static_cast<std::uint64_t>(block.columns) * static_cast<std::uint64_t>(block.rows);
  });
  return cells;
}

/// Centres of cells, each cell as likely as any other.
std::vector<Point> random_points(const Cells& cells, int count, std::uint64_t seed) {
  Draws draws(seed);
  std::vector<Point> points;
  for (int i = 0; i < count; ++i) {
    const std::uint64_t cell = draws.below(cells.count);
    const auto at = std::ranges::upper_bound(cells.first, cell) - cells.first.begin() - 1;
    const CellBlock& block = cells.blocks[static_cast<std::size_t>(at)];
    const auto in_block = static_cast<std::int64_t>(cell - cells.first[static_cast<std::size_t>(at)]);
    const std::int64_t x = block.x_um + in_block % block.columns * block.cell_x_um + block.cell_x_um / 2;
    const std::int64_t y = block.y_um + in_block / block.columns * block.cell_y_um + block.cell_y_um / 2;
    points.push_back({static_cast<double>(x) / 1e6, static_cast<double>(y) / 1e6});
  }
  return points;
}

/// Keeps what was read from being optimised away.
void use(std::uint32_t value) { static_cast<void>(*static_cast<volatile std::uint32_t*>(&value)); }

class Meter {
 public:
  Meter(const Layout& layout, Point vehicle, std::uint64_t seed, const CostOptions& options)
      : layout_(layout),
        vehicle_(vehicle),
        options_(options),
        now_ns_(options.now_ns ? options.now_ns : steady_now_ns),
        cells_(cells_of(layout)) {
    if (options.accesses < 1 || options.shifts < 1 || options.growths < 1) {
      throw Error(ErrorCode::kInvalidArgument, "numbers of accesses, shifts and growths are at least 1");
    }
    if (cells_.count == 0) throw Error(ErrorCode::kInvalidArgument, "the layout holds no cells to measure");
    points_ = random_points(cells_, options.accesses, seed);
  }

  LayoutCost run() {
    LayoutCost cost;
    std::unique_ptr<Layout> copy;
    cost.snapshot_ns = time([&] { copy = layout_.snapshot(); });
    cost.find_ns = time([&] { find(); }) / options_.accesses;
    cost.iterate_ns = time([&] { iterate(); }) / static_cast<double>(cells_.count);
    // A tile with copy on write is copied once: the first round is not measured.
    insert(*copy);
    cost.insert_ns = time([&] { insert(*copy); }) / options_.accesses;
    cost.grow_ns = grow(*copy);
    copy = layout_.snapshot();
    copy->move_to(vehicle_);
    cost.shift_ns = time([&] { shift(*copy); }) / options_.shifts;
    return cost;
  }

 private:
  template <class Work>
  double time(Work&& work) const {
    const std::int64_t start = now_ns_();
    work();
    return static_cast<double>(now_ns_() - start);
  }

  void find() const {
    std::uint32_t bits = 0;
    for (const Point p : points_) {
      if (const float* cell = layout_.find(p)) bits ^= std::bit_cast<std::uint32_t>(*cell);
    }
    use(bits);
  }

  void insert(Layout& copy) const {
    const auto& values = layout_.schema().background();
    for (const Point p : points_) {
      if (float* cell = copy.insert(p)) std::copy(values.begin(), values.end(), cell);
    }
  }

  void iterate() const {
    // Not a sum of floats: its chain of additions would cost more than the memory.
    std::uint32_t bits = 0;
    layout_.for_each_block([&](const CellBlock& block) {
      for (int b = 0; b < block.rows; ++b) {
        const float* value = block.cells + b * block.row_stride;
        const float* end = value + std::int64_t{block.columns} * layout_.schema().values();
        for (; value != end; ++value) bits ^= std::bit_cast<std::uint32_t>(*value);
      }
    });
    use(bits);
  }

  /// One sub-map after the other to the right of all.
  double grow(Layout& copy) const {
    const std::int64_t edge = layout_.frame().edge_um;
    double total = 0;
    int grown = 0;
    for (int i = 0; i < options_.growths; ++i) {
      const Point p{static_cast<double>(cells_.extent.x1_um + i * edge + edge / 2) / 1e6,
                    static_cast<double>(cells_.extent.y0_um) / 1e6};
      if (copy.find(p) != nullptr) continue;
      const float* made = nullptr;
      total += time([&] { made = copy.insert(p); });
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
  std::function<std::int64_t()> now_ns_;
  Cells cells_;
  std::vector<Point> points_;
};

}  // namespace

LayoutCost measure_cost(const Layout& layout, Point vehicle, std::uint64_t seed, const CostOptions& options) {
  return Meter(layout, vehicle, seed, options).run();
}

}  // namespace apgm
