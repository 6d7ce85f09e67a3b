#include "observe/upkeep.hpp"

#include <algorithm>
#include <array>
#include <cstddef>

#include "apgm/core/portable_math.hpp"
#include "fuse/simd.hpp"

namespace apgm::observe {
namespace {

constexpr double kLeastLeft = 0.99;
constexpr int kShortest = -9, kLongest = 30;  // powers of two of a second: whole nanoseconds, no overflow
constexpr std::size_t kBlock = 512;
constexpr float kSlack = 1e-6f;

/// One tick after the other, as if the layer had been looked at in each.
APGM_CLONES void fade(float* masses, std::size_t cells, float factor, int ticks) {
  for (std::size_t first = 0; first < cells; first += kBlock) {
    float* const m = masses + first;
    const std::size_t n = std::min(kBlock, cells - first);
    for (int t = 0; t < ticks; ++t) {
      for (std::size_t i = 0; i < n; ++i) m[i] *= factor;
    }
    for (std::size_t i = 0; i < n; ++i) m[i] = m[i] < Ageing::kForgotten ? 0.0f : m[i];
  }
}

/// Sums of the masses of cells, in the order of the channels.
APGM_INLINE void sum_masses(float* const* masses, std::size_t channels, std::size_t first, std::size_t n,
                            float* sum) {
  std::fill_n(sum, n, 0.0f);
  for (std::size_t c = 0; c < channels; ++c) {
    const float* const m = masses[c] + first;
    for (std::size_t i = 0; i < n; ++i) sum[i] += m[i];
  }
}

APGM_CLONES void restore_omega(float* const* masses, std::size_t channels, float* omega, std::size_t cells) {
  std::array<float, kBlock> sum;
  for (std::size_t first = 0; first < cells; first += kBlock) {
    const std::size_t n = std::min(kBlock, cells - first);
    sum_masses(masses, channels, first, n, sum.data());
    for (std::size_t i = 0; i < n; ++i) omega[first + i] = sum[i] < 1.0f ? 1.0f - sum[i] : 0.0f;
  }
}

/// @param omega  nullptr where it is implicit
APGM_CLONES void bound_sums(float* const* masses, std::size_t channels, float* omega, std::size_t cells,
                            float most) {
  std::array<float, kBlock> sum, scale;
  for (std::size_t first = 0; first < cells; first += kBlock) {
    const std::size_t n = std::min(kBlock, cells - first);
    sum_masses(masses, channels, first, n, sum.data());
    for (std::size_t i = 0; i < n; ++i) scale[i] = sum[i] > most + kSlack ? most / sum[i] : 1.0f;
    for (std::size_t c = 0; c < channels; ++c) {
      float* const m = masses[c] + first;
      for (std::size_t i = 0; i < n; ++i) m[i] *= scale[i];
    }
    if (omega == nullptr) continue;
    sum_masses(masses, channels, first, n, sum.data());
    for (std::size_t i = 0; i < n; ++i) {
      omega[first + i] = scale[i] < 1.0f ? 1.0f - sum[i] : omega[first + i];
    }
  }
}

/// Planes of masses, from cell `first` on.
struct Masses {
  std::array<float*, 16> planes{};
  std::size_t count = 0;
  float* omega = nullptr;

  Masses(Layer& layer, const LayerType& type, std::size_t first) : count(type.hypotheses.size()) {
    for (std::size_t c = 0; c < count; ++c) planes[c] = layer.plane(static_cast<int>(c)).data() + first;
    if (type.stores_omega()) omega = layer.plane(static_cast<int>(count)).data() + first;
  }
};

}  // namespace

Ageing::Ageing(double per_s) {
  const double rate = portable::log(per_s);
  const auto left = [&](int power) {
    return portable::exp(power < 0 ? rate / (1 << -power) : rate * static_cast<double>(1 << power));
  };
  if (left(kLongest) > kLeastLeft) return;  // a hundredth in 34 years
  int power = kLongest;
  while (power > kShortest && left(power) < kLeastLeft) --power;
  factor_ = static_cast<float>(left(power));
  tick_ns_ = power < 0 ? 1'000'000'000 >> -power : std::int64_t{1'000'000'000} << power;
  for (float m = 1; m >= kForgotten; m *= factor_) ++most_ticks_;
}

void Ageing::apply(Layer& layer, const LayerType& type, std::int64_t ticks) const {
  if (ticks <= 0 || !active() || !type.is_evidence()) return;
  const Masses masses(layer, type, 0);
  const int n = static_cast<int>(std::min<std::int64_t>(ticks, most_ticks_));
  for (std::size_t c = 0; c < masses.count; ++c) fade(masses.planes[c], layer.cells(), factor_, n);
  if (masses.omega != nullptr) {
    restore_omega(masses.planes.data(), masses.count, masses.omega, layer.cells());
  }
}

void keep_unknown(Layer& layer, const LayerType& type, RowRange rows, float min_unknown) {
  if (!(min_unknown > 0) || !type.is_evidence() || rows.empty()) return;
  const auto side = static_cast<std::size_t>(layer.side());
  const Masses masses(layer, type, static_cast<std::size_t>(rows.begin) * side);
  bound_sums(masses.planes.data(), masses.count, masses.omega,
             static_cast<std::size_t>(rows.end - rows.begin) * side, 1.0f - min_unknown);
}

}  // namespace apgm::observe
