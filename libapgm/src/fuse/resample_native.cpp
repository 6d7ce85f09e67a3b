#include "fuse/resample_native.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "fuse/belief.hpp"
#include "fuse/evidence.hpp"
#include "fuse/resample_loops.hpp"

namespace apgm::fuse {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

/// Calls visit(index in the input) for the cells under the `i`-th of `cells`, row by row.
template <class Visit>
void visit_cells(const CoarseCells& cells, std::size_t i, Visit&& visit) {
  const int levels = cells.in.step() - cells.step;
  const std::size_t n = std::size_t{1} << levels;
  const std::size_t side = std::size_t{1} << cells.step;
  const std::size_t cell = cells.first + i;
  const std::size_t first = (cell / side * n) * (side * n) + cell % side * n;
  for (std::size_t b = 0; b < n; ++b) {
    for (std::size_t a = 0; a < n; ++a) visit(first + b * (side * n) + a);
  }
}

/// Median of a set of numbers; of an even number of them, the mean of the two in the middle.
float median(std::vector<float>& v) {
  const auto middle = v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2);
  std::nth_element(v.begin(), middle, v.end());
  if (v.size() % 2 == 1) return *middle;
  return 0.5f * (*std::max_element(v.begin(), middle) + *middle);
}

struct Pool {
  double value = 0;
  std::size_t numbers = 0;

  void add(Policy policy, double v) {
    switch (policy) {
      case Policy::kMinimum:
        value = numbers == 0 ? v : std::min(value, v);
        break;
      case Policy::kMaximum:
        value = numbers == 0 ? v : std::max(value, v);
        break;
      default:
        value += v;
    }
    ++numbers;
  }
};

}  // namespace

void merge_evidence(const CoarseCells& cells, const LayerType& type, std::span<float* const> out) {
  const std::size_t hypotheses = type.hypotheses.size();
  const float* omega = cells.in.plane(static_cast<int>(hypotheses)).data();
  std::array<const float*, 16> m{};
  for (std::size_t k = 0; k < hypotheses; ++k) m[k] = cells.in.plane(static_cast<int>(k)).data();
  for (std::size_t i = 0; i < cells.count; ++i) {
    std::array<double, 16> lambda{};
    visit_cells(cells, i, [&](std::size_t cell) {
      double sum = 0;
      for (std::size_t k = 0; k < hypotheses; ++k) sum += static_cast<double>(m[k][cell]);
      if (!(sum > 0)) return;
      const double share = evidence(sum, static_cast<double>(omega[cell])) / sum;
      for (std::size_t k = 0; k < hypotheses; ++k) lambda[k] += static_cast<double>(m[k][cell]) * share;
    });
    std::array<float, 16> merged{};
    float left = 1;
    masses_from_evidence(lambda.data(), hypotheses, merged.data(), left);
    for (std::size_t k = 0; k < hypotheses; ++k) out[k][i] = merged[k];
    out[hypotheses][i] = left;
  }
}

void split_evidence(const ConstCells& in, const LayerType& type, int levels, const Cells& out,
                    std::size_t count) {
  const std::size_t hypotheses = type.hypotheses.size();
  for (std::size_t i = 0; i < count; ++i) {
    double sum = 0;
    for (std::size_t k = 0; k < hypotheses; ++k) sum += static_cast<double>(in[k][i]);
    const float omega = in[hypotheses][i];
    double part = sum <= 0.5 ? sum : 1.0 - static_cast<double>(omega);
    double rest = 1.0 - part;
    for (int h = 0; h < 2 * levels; ++h) {
      rest = std::sqrt(rest);
      part = part / (1.0 + rest);
    }
    const double share = sum > 0 ? part / sum : 0.0;
    for (std::size_t k = 0; k < hypotheses; ++k) {
      out[k][i] = static_cast<float>(static_cast<double>(in[k][i]) * share);
    }
    out[hypotheses][i] = sum > 0 ? static_cast<float>(1.0 - part) : omega;
  }
}

void merge_median(const CoarseCells& cells, std::span<float* const> out) {
  const float *o = cells.in.plane(0).data(), *f = cells.in.plane(1).data();
  std::vector<float> phi;
  for (std::size_t i = 0; i < cells.count; ++i) {
    float merged = 0;
    phi.clear();
    visit_cells(cells, i, [&](std::size_t cell) {
      merged = loop::either(merged, o[cell]);
      phi.push_back(loop::conditional_free(o[cell], f[cell]));
    });
    out[0][i] = merged;
    out[1][i] = (1.0f - merged) * median(phi);
  }
}

void merge_dempster(const CoarseCells& cells, std::span<float* const> out) {
  const float *o = cells.in.plane(0).data(), *f = cells.in.plane(1).data();
  for (std::size_t i = 0; i < cells.count; ++i) {
    Occupancy all;
    visit_cells(cells, i, [&](std::size_t cell) { all = dempster_data(all, occupancy(o[cell], f[cell])); });
    out[0][i] = all.o;
    out[1][i] = bounded(all).f;
  }
}

void merge_pool(const CoarseCells& cells, const LayerType& type, std::span<float* const> out) {
  constexpr double kMost = std::numeric_limits<float>::max();
  for (int c = 0; c < cells.in.channels(); ++c) {
    const float* values = cells.in.plane(c).data();
    for (std::size_t i = 0; i < cells.count; ++i) {
      Pool pool;
      visit_cells(cells, i, [&](std::size_t cell) {
        if (values[cell] == values[cell]) pool.add(type.policy, static_cast<double>(values[cell]));
      });
      if (type.policy == Policy::kMean)
        pool.value /= static_cast<double>(std::max<std::size_t>(pool.numbers, 1));
      out[static_cast<std::size_t>(c)][i] =
          pool.numbers == 0 ? type.background(c) : static_cast<float>(std::clamp(pool.value, -kMost, kMost));
    }
  }
}

}  // namespace apgm::fuse
