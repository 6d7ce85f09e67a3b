#include "resample_loss.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "fuse/simd.hpp"

namespace apgm {

void ResampleLoss::add(const ResampleLoss& other) {
  known_cells += other.known_cells;
  sum += other.sum;
  most = std::max(most, other.most);
  obstacles += other.obstacles;
}

namespace ops {
namespace {

void count(double change, ResampleLoss& loss) {
  ++loss.known_cells;
  loss.sum += change;
  loss.most = std::max(loss.most, change);
}

/// Sums by column: each is a sum of its own, so that the loop over a row is vector code without any sum being
/// reordered.
struct Columns {
  explicit Columns(std::size_t n) : merged(n), clear(n), sum(n), most(n), known(n), obstacles(n) {}
  std::vector<double> merged;       // O - F of the cell of the result
  std::vector<std::int32_t> clear;  // 1 where that is no obstacle
  std::vector<double> sum, most;
  std::vector<std::int32_t> known, obstacles;
};

APGM_CLONES void add_changes(const float* o, const float* f, const double* merged, std::size_t n, double* sum,
                             double* most) {
  APGM_IVDEP
  for (std::size_t a = 0; a < n; ++a) {
    const double before = static_cast<double>(o[a]) - static_cast<double>(f[a]);
    const double change = o[a] + f[a] > 0.0f ? std::fabs(before - merged[a]) : 0.0;
    sum[a] += change;
    most[a] = change > most[a] ? change : most[a];
  }
}

APGM_CLONES void add_counts(const float* o, const float* f, const std::int32_t* clear, std::size_t n,
                            std::int32_t* known, std::int32_t* obstacles) {
  APGM_IVDEP
  for (std::size_t a = 0; a < n; ++a) {
    known[a] += o[a] + f[a] > 0.0f ? 1 : 0;
    obstacles[a] += o[a] > f[a] ? clear[a] : 0;
  }
}

/// Spreads a row of the result over the `n` columns of the layer it came from.
APGM_CLONES void take_merged(const float* o, const float* f, int levels, std::size_t n, double* merged,
                             std::int32_t* clear) {
  const auto difference = [&](std::size_t i) {
    return static_cast<double>(o[i]) - static_cast<double>(f[i]);
  };
  const std::size_t copies = std::size_t{1} << levels;
  if (copies == 2) {
    for (std::size_t i = 0; i < n / 2; ++i) merged[2 * i] = merged[2 * i + 1] = difference(i);
  } else {
    for (std::size_t i = 0; i < n / copies; ++i) std::fill_n(merged + i * copies, copies, difference(i));
  }
  for (std::size_t a = 0; a < n; ++a) clear[a] = merged[a] <= 0.0 ? 1 : 0;
}

/// {O, F}: BetP(O) = (1 + O - F) / 2, and BetP(F) changes by as much.
void measure_occupancy(const Layer& native, const Layer& out, ResampleLoss& loss) {
  const int levels = native.step() - out.step();
  const auto side = static_cast<std::size_t>(native.side());
  Columns columns(side);
  for (std::size_t b = 0; b < side; ++b) {
    if ((b & ((std::size_t{1} << levels) - 1)) == 0) {
      const std::size_t row = (b >> levels) * (side >> levels);
      take_merged(out.plane(0).data() + row, out.plane(1).data() + row, levels, side, columns.merged.data(),
                  columns.clear.data());
    }
    const float *o = native.plane(0).data() + b * side, *f = native.plane(1).data() + b * side;
    add_changes(o, f, columns.merged.data(), side, columns.sum.data(), columns.most.data());
    add_counts(o, f, columns.clear.data(), side, columns.known.data(), columns.obstacles.data());
  }
  for (std::size_t a = 0; a < side; ++a) {
    loss.sum += columns.sum[a] / 2;
    loss.most = std::max(loss.most, columns.most[a] / 2);
    loss.known_cells += static_cast<std::uint64_t>(columns.known[a]);
    loss.obstacles += static_cast<std::uint64_t>(columns.obstacles[a]);
  }
}

/// All parts of a split cell are equal: the first stands for them.
void count_obstacles_of_split(const Layer& native, const Layer& out, ResampleLoss& loss) {
  const int levels = out.step() - native.step();
  for (std::int32_t b = 0; b < native.side(); ++b) {
    for (std::int32_t a = 0; a < native.side(); ++a) {
      const CellIndex part{a << levels, b << levels};
      loss.obstacles += native.at(0, {a, b}) > native.at(1, {a, b}) && !(out.at(0, part) > out.at(1, part));
    }
  }
}

constexpr std::size_t kMaxChannels = 16;
using Values = std::array<double, kMaxChannels>;

/// BetP of a cell's hypotheses; false if it holds no data.
bool bet(const Layer& layer, const LayerType& type, CellIndex cell, Values& out) {
  const std::size_t n = type.hypotheses.size();
  double sum = 0;
  for (std::size_t k = 0; k < n; ++k) {
    out[k] = static_cast<double>(layer.at(static_cast<int>(k), cell));
    sum += out[k];
  }
  const double omega = type.stores_omega() ? static_cast<double>(layer.at(static_cast<int>(n), cell))
                                           : std::max(0.0, 1.0 - sum);
  for (std::size_t k = 0; k < n; ++k) out[k] += omega / static_cast<double>(n);
  return sum > 0;
}

/// Numbers of a cell; false if it holds none.
bool numbers(const Layer& layer, const LayerType& type, CellIndex cell, Values& out) {
  bool known = false;
  for (std::size_t c = 0; c < type.channels.size(); ++c) {
    const float v = layer.at(static_cast<int>(c), cell);
    out[c] = static_cast<double>(v);
    known |= type.policy == Policy::kSum ? v != 0.0f : !std::isnan(v);
  }
  return known;
}

double greatest_change(const Values& before, const Values& after, std::size_t n) {
  double most = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double change = std::fabs(before[i] - after[i]);
    if (change > most) most = change;  // no number before: no change
  }
  return most;
}

void measure_any(const Layer& native, const LayerType& type, const Layer& out, ResampleLoss& loss) {
  const int levels = native.step() - out.step();
  const double share = type.policy == Policy::kSum ? std::ldexp(1.0, -2 * levels) : 1.0;
  const std::size_t n = type.is_evidence() ? type.hypotheses.size() : type.channels.size();
  const auto read = type.is_evidence() ? bet : numbers;
  Values before{}, after{};
  for (std::int32_t b = 0; b < native.side(); ++b) {
    for (std::int32_t a = 0; a < native.side(); ++a) {
      if (!read(native, type, {a, b}, before)) continue;
      read(out, type, {a >> levels, b >> levels}, after);
      for (std::size_t i = 0; i < n; ++i) after[i] *= share;
      count(greatest_change(before, after, n), loss);
    }
  }
}

}  // namespace

ResampleLoss measure_loss(const Layer& native, const LayerType& type, const Layer& out) {
  ResampleLoss loss;
  if (out.step() > native.step()) {
    if (type.is_occupancy()) count_obstacles_of_split(native, out, loss);
  } else if (type.is_occupancy()) {
    measure_occupancy(native, out, loss);
  } else {
    measure_any(native, type, out, loss);
  }
  return loss;
}

}  // namespace ops
}  // namespace apgm
