#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <random>
#include <utility>
#include <vector>

#include "apgm/core/layer.hpp"

namespace apgm::test {

using Random = std::mt19937_64;

inline float uniform(Random& random) { return std::uniform_real_distribution<float>(0, 1)(random); }

/// A mass of any magnitude, with the values that break arithmetic among them.
inline float any_mass(Random& random) {
  static constexpr std::array<float, 9> kCorners{0.0f, 1.0f, 1e-12f,          1e-40f,      0x1p-149f,
                                                 0.5f, 0.9f, 1.0f - 0x1p-24f, 1.0f - 1e-7f};
  switch (random() % 4) {
    case 0:
      return kCorners[random() % kCorners.size()];
    case 1:
      return std::pow(10.0f, -20.0f * uniform(random));
    case 2:
      return 1.0f - std::pow(10.0f, -7.0f * uniform(random));
    default:
      return uniform(random);
  }
}

/// Occupancy with about `vacuous` of the cells without data; masses of all magnitudes, float(O + F) <= 1.
inline Layer random_occupancy(int step, Random& random, float vacuous = 0.3f) {
  Layer layer(LayerType::occupancy(), step);
  for (std::size_t i = 0; i < layer.cells(); ++i) {
    if (uniform(random) < vacuous) continue;
    float o = any_mass(random), f = any_mass(random);
    if (o + f > 1.0f) f = std::min(f, 1.0f - o);
    if (random() % 2 == 0) std::swap(o, f);
    layer.plane(0)[i] = o;
    layer.plane(1)[i] = f;
  }
  return layer;
}

/// As measured by an exclusive model: each cell free, occupied, or without data.
inline Layer random_exclusive(int step, Random& random) {
  Layer layer(LayerType::occupancy(), step);
  for (std::size_t i = 0; i < layer.cells(); ++i) {
    if (random() % 3 != 0) layer.plane(static_cast<int>(random() % 2))[i] = any_mass(random);
  }
  return layer;
}

/// Singletons and m(Omega).
inline Layer random_semantic(const LayerType& type, int step, Random& random, float vacuous = 0.3f) {
  Layer layer(type, step);
  const int n = static_cast<int>(type.hypotheses.size());
  for (std::size_t i = 0; i < layer.cells(); ++i) {
    if (uniform(random) < vacuous) continue;
    double total = 0;
    std::vector<double> m(static_cast<std::size_t>(n) + 1);
    for (double& v : m) total += v = std::pow(static_cast<double>(uniform(random)), 4.0) + 1e-3;
    for (int k = 0; k <= n; ++k)
      layer.plane(k)[i] = static_cast<float>(m[static_cast<std::size_t>(k)] / total);
  }
  return layer;
}

inline Layer random_real(const LayerType& type, int step, Random& random) {
  Layer layer(type, step);
  for (int c = 0; c < layer.channels(); ++c) {
    for (float& v : layer.plane(c)) {
      if (random() % 3 != 0) v = 10 * uniform(random) - 5;
    }
  }
  return layer;
}

/// An occupancy layer of one row of cells after the other.
inline Layer occupancy_of(int step, std::initializer_list<std::pair<float, float>> cells) {
  Layer layer(LayerType::occupancy(), step);
  std::size_t i = 0;
  for (const auto& [o, f] : cells) {
    layer.plane(0)[i] = o;
    layer.plane(1)[i++] = f;
  }
  return layer;
}

/// Greatest difference of two layers of one shape; NaN equals NaN.
inline float difference(const Layer& a, const Layer& b) {
  float most = 0;
  for (int c = 0; c < a.channels(); ++c) {
    for (std::size_t i = 0; i < a.cells(); ++i) {
      const float p = a.plane(c)[i], q = b.plane(c)[i];
      if (std::isnan(p) && std::isnan(q)) continue;
      const float d = std::fabs(p - q);
      if (!(d <= most)) most = std::isnan(d) ? INFINITY : d;
    }
  }
  return most;
}

/// Sum of -ln(1 - m(O)) over a layer.
inline long double sum_lambda(const Layer& layer) {
  long double sum = 0;
  for (const float o : layer.plane(0)) sum -= log1pl(-static_cast<long double>(o));
  return sum;
}

/// Cells with a mass out of [0, 1] or masses above 1 in sum, in float32.
inline std::size_t invalid_cells(const Layer& layer) {
  std::size_t bad = 0;
  for (std::size_t i = 0; i < layer.cells(); ++i) {
    const float o = layer.plane(0)[i], f = layer.plane(1)[i];
    bad += !(o >= 0.0f && o <= 1.0f && f >= 0.0f && f <= 1.0f && o + f <= 1.0f);
  }
  return bad;
}

}  // namespace apgm::test
