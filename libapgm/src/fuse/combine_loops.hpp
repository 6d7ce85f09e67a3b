#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>

#include "fuse/belief.hpp"
#include "fuse/combine_kernels.hpp"

/// Bodies of the kernels, inlined into each clone (and into the tests, which compare the clones with them).
namespace apgm::fuse::loop {

/// Whole numbers in the order of the floats, for every bit pattern.
APGM_INLINE std::int32_t order_key(float v) {
  const auto bits = std::bit_cast<std::int32_t>(v);
  return bits ^ ((bits >> 31) & 0x7fffffff);
}

APGM_INLINE void exchange(float* low, float* high, std::size_t width) {
  std::int32_t greater[kBlock];
  std::int32_t equal[kBlock];
  for (std::size_t x = 0; x < kBlock; ++x) {
    const std::int32_t p = order_key(low[x]), q = order_key(high[x]);
    greater[x] = p > q ? -1 : 0;
    equal[x] = p == q ? -1 : 0;
  }
  for (std::size_t c = 1; c < width; ++c) {
    for (std::size_t x = 0; x < kBlock; ++x) {
      const std::int32_t p = order_key(low[c * kBlock + x]), q = order_key(high[c * kBlock + x]);
      greater[x] |= equal[x] & (p > q ? -1 : 0);
      equal[x] &= p == q ? -1 : 0;
    }
  }
  for (std::size_t c = 0; c < width; ++c) {
    float* __restrict p = low + c * kBlock;
    float* __restrict q = high + c * kBlock;
    for (std::size_t x = 0; x < kBlock; ++x) {
      const float v = p[x], w = q[x];
      p[x] = greater[x] != 0 ? w : v;
      q[x] = greater[x] != 0 ? v : w;
    }
  }
}

/// Batcher's merge exchange sort for any number of inputs (Knuth, The Art of Computer Programming 3, 5.2.2,
/// algorithm M): the same exchanges in every cell, so all cells of a block go at once.
APGM_INLINE void sort_inputs(float* rows, std::size_t inputs, std::size_t width) {
  if (inputs < 2) return;
  const std::size_t stride = width * kBlock;
  const std::size_t top = std::bit_ceil(inputs) / 2;
  for (std::size_t p = top; p > 0; p /= 2) {
    std::size_t q = top, r = 0, d = p;
    while (true) {
      for (std::size_t i = 0; i + d < inputs; ++i) {
        if ((i & p) == r) exchange(rows + i * stride, rows + (i + d) * stride, width);
      }
      if (q == p) break;
      d = q - p;
      q /= 2;
      r = p;
    }
  }
}

APGM_INLINE void omit_masses(const float* rows, std::size_t hypotheses, float* __restrict omega) {
  float lost[kBlock] = {};
  for (std::size_t x = 0; x < kBlock; ++x) omega[x] = rows[x];
  for (std::size_t c = 1; c < hypotheses; ++c) {
    for (std::size_t x = 0; x < kBlock; ++x) {
      RunningSum s{omega[x], lost[x]};
      s.add(rows[c * kBlock + x]);
      omega[x] = s.sum;
      lost[x] = s.lost;
    }
  }
  for (std::size_t x = 0; x < kBlock; ++x) omega[x] = RunningSum{omega[x], lost[x]}.rest();
}

APGM_INLINE void holds_belief(const float* rows, std::size_t hypotheses, std::int32_t* __restrict holds) {
  for (std::size_t x = 0; x < kBlock; ++x) holds[x] = rows[hypotheses * kBlock + x] != 1.0f ? 1 : 0;
  for (std::size_t c = 0; c < hypotheses; ++c) {
    for (std::size_t x = 0; x < kBlock; ++x) holds[x] |= rows[c * kBlock + x] != 0.0f ? 1 : 0;
  }
}

/// K <- or(K, k): what is left of the mass after all conflicts so far is (1 - K) (1 - k). Without
/// normalisation the masses of `acc` sum to 1 - K already, and the new conflict adds.
APGM_INLINE void fold_conflict(const float* acc, const float* in, std::size_t hypotheses,
                               const std::int32_t* held, const std::int32_t* holds, float* __restrict k,
                               bool normalise) {
  float met[kBlock] = {};
  for (std::size_t p = 0; p < hypotheses; ++p) {
    for (std::size_t q = p + 1; q < hypotheses; ++q) {
      for (std::size_t x = 0; x < kBlock; ++x) {
        met[x] += acc[p * kBlock + x] * in[q * kBlock + x] + acc[q * kBlock + x] * in[p * kBlock + x];
      }
    }
  }
  for (std::size_t x = 0; x < kBlock; ++x) {
    const float left = normalise ? 1.0f - k[x] : 1.0f;
    const float sum = k[x] + met[x] * left;
    const bool both = (held[x] > 0) & (holds[x] != 0);
    k[x] = both ? (sum < 1.0f ? sum : 1.0f) : k[x];
  }
}

/// The quotients of a fold are rounded: their sum may exceed 1 by a few units. Only at the end: between folds
/// it would take the small masses that a later conflict makes great.
APGM_INLINE void bound_masses(float* __restrict acc, std::size_t hypotheses, const std::int32_t* held) {
  float before[kBlock] = {};
  for (std::size_t c = 0; c < hypotheses; ++c) {
    float* __restrict a = acc + c * kBlock;
    for (std::size_t x = 0; x < kBlock; ++x) {
      const float room = 1.0f - before[x];
      const float most = room > 0.0f ? room : 0.0f;
      const float m = ((held[x] > 1) & (a[x] > most)) ? most : a[x];
      before[x] += m;
      a[x] = m;
    }
  }
}

/// The same arithmetic as conjoin() and dempster() on {O, F}, in the same order.
APGM_INLINE void fold(float* __restrict acc, const float* in, std::size_t hypotheses, bool normalise,
                      std::int32_t* __restrict held, const std::int32_t* holds) {
  const float scale = normalise ? kProductScale : 1.0f;
  const float* au = acc + hypotheses * kBlock;
  const float* bu = in + hypotheses * kBlock;
  float product[16][kBlock];
  float sum[kBlock] = {};
  for (std::size_t c = 0; c < hypotheses; ++c) {
    const float* __restrict a = acc + c * kBlock;
    const float* b = in + c * kBlock;
    for (std::size_t x = 0; x < kBlock; ++x) {
      const float as = a[x] * scale;
      product[c][x] = as * b[x] + (as * bu[x] + (au[x] * scale) * b[x]);
      sum[x] += product[c][x];
    }
  }
  for (std::size_t x = 0; x < kBlock; ++x) {
    product[hypotheses][x] = (au[x] * scale) * bu[x];
    sum[x] += product[hypotheses][x];
    sum[x] = normalise && sum[x] != 0.0f ? sum[x] : 1.0f;
  }
  for (std::size_t c = 0; c <= hypotheses; ++c) {
    float* __restrict a = acc + c * kBlock;
    const float* b = in + c * kBlock;
    for (std::size_t x = 0; x < kBlock; ++x) {
      const float merged = holds[x] != 0 ? product[c][x] / sum[x] : a[x];
      a[x] = held[x] > 0 ? merged : b[x];
    }
  }
  for (std::size_t x = 0; x < kBlock; ++x) held[x] += holds[x];
}

}  // namespace apgm::fuse::loop
