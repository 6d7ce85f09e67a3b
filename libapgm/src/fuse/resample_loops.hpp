#pragma once

#include <cmath>
#include <cstddef>

#include "fuse/resample_kernels.hpp"
#include "fuse/simd.hpp"

/// Bodies of the kernels, inlined into each clone (and into the tests, which compare the clones with them).
namespace apgm::fuse::loop {

APGM_INLINE float least(float a, float b) { return a < b ? a : b; }
APGM_INLINE float greatest(float a, float b) { return a > b ? a : b; }

/// 1 - (1 - a)(1 - b), the sum of two lambdas. The greater operand leads: never below it, and commutative.
APGM_INLINE float either(float a, float b) {
  const float hi = greatest(a, b);
  return hi + least(a, b) * (1.0f - hi);
}

/// m <- 1 - sqrt(1 - m), half of lambda, without the cancellation. `rest` is 1 - m and goes along: taken from
/// a rounded m again, it would lose its digits near m = 1.
APGM_INLINE void halve(float& m, float& rest) {
  rest = std::sqrt(rest);
  m = m / (1.0f + rest);
}

/// phi = m(F) / (1 - m(O)); 0 where m(O) = 1.
APGM_INLINE float conditional_free(float o, float f) {
  const float rest = 1.0f - o;
  const float phi = f / (rest > 0.0f ? rest : 1.0f);
  return rest > 0.0f ? least(phi, 1.0f) : 0.0f;
}

/// m(F) of the merged cell `o` from the four cells.
template <Policy kPolicy>
APGM_INLINE float merged_free(float o, const float (&co)[4], const float (&cf)[4]) {
  if constexpr (kPolicy == Policy::kExclusive) {
    const float mean = ((cf[0] + cf[1]) + (cf[2] + cf[3])) * 0.25f;
    return o > 0.0f ? 0.0f : mean;
  } else if constexpr (kPolicy == Policy::kProduct) {
    return least((cf[0] * cf[1]) * (cf[2] * cf[3]), 1.0f - o);
  } else {
    float phi[4];
    for (int i = 0; i < 4; ++i) phi[i] = conditional_free(co[i], cf[i]);
    const float pooled = kPolicy == Policy::kMin ? least(least(phi[0], phi[1]), least(phi[2], phi[3]))
                                                 : ((phi[0] + phi[1]) + (phi[2] + phi[3])) * 0.25f;
    return (1.0f - o) * pooled;
  }
}

template <Policy kPolicy>
APGM_INLINE void merge_row(const RowPair& in, float* __restrict o, float* __restrict f, std::size_t n) {
  const float *o0 = in.o[0], *o1 = in.o[1], *f0 = in.f[0], *f1 = in.f[1];
  APGM_IVDEP
  for (std::size_t i = 0; i < n; ++i) {
    const float co[4] = {o0[2 * i], o0[2 * i + 1], o1[2 * i], o1[2 * i + 1]};
    const float cf[4] = {f0[2 * i], f0[2 * i + 1], f1[2 * i], f1[2 * i + 1]};
    const float merged = either(either(co[0], co[1]), either(co[2], co[3]));
    o[i] = merged;
    f[i] = merged_free<kPolicy>(merged, co, cf);
  }
}

template <Policy kPolicy>
APGM_INLINE void merge_rows(const RowPair& in, float* o, float* f, std::size_t n, std::size_t rows) {
  for (std::size_t r = 0; r < rows; ++r) {
    const std::size_t at = 4 * n * r;
    merge_row<kPolicy>({{in.o[0] + at, in.o[1] + at}, {in.f[0] + at, in.f[1] + at}}, o + n * r, f + n * r, n);
  }
}

APGM_INLINE void merge_rows(Policy policy, const RowPair& in, float* o, float* f, std::size_t n,
                            std::size_t rows) {
  switch (policy) {
    case Policy::kExclusive:
      return merge_rows<Policy::kExclusive>(in, o, f, n, rows);
    case Policy::kMin:
      return merge_rows<Policy::kMin>(in, o, f, n, rows);
    case Policy::kProduct:
      return merge_rows<Policy::kProduct>(in, o, f, n, rows);
    default:
      return merge_rows<Policy::kConditional>(in, o, f, n, rows);
  }
}

/// `kLevels` levels, or `levels` where it is 0: a number the compiler knows lets the loop over cells be
/// vector code.
template <Policy kPolicy, int kLevels>
APGM_INLINE void split_cells(int levels, const float* o, const float* f, float* __restrict out_o,
                             float* __restrict out_f, std::size_t n) {
  const int halvings = 2 * (kLevels > 0 ? kLevels : levels);
  APGM_IVDEP
  for (std::size_t i = 0; i < n; ++i) {
    float part = o[i];
    float rest = 1.0f - part;
    float free = f[i];
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC unroll 6
#endif
    for (int h = 0; h < halvings; ++h) {
      halve(part, rest);
      // The product of the parts must give m(F) back: its n-th root.
      if constexpr (kPolicy == Policy::kProduct) free = std::sqrt(free);
    }
    if constexpr (kPolicy == Policy::kConditional) free = (1.0f - part) * conditional_free(o[i], free);
    if constexpr (kPolicy == Policy::kProduct) free = least(free, 1.0f - part);
    out_o[i] = part;
    out_f[i] = free;
  }
}

template <Policy kPolicy>
APGM_INLINE void split_cells(int levels, const float* o, const float* f, float* out_o, float* out_f,
                             std::size_t n) {
  switch (levels) {
    case 1:
      return split_cells<kPolicy, 1>(levels, o, f, out_o, out_f, n);
    case 2:
      return split_cells<kPolicy, 2>(levels, o, f, out_o, out_f, n);
    case 3:
      return split_cells<kPolicy, 3>(levels, o, f, out_o, out_f, n);
    default:
      return split_cells<kPolicy, 0>(levels, o, f, out_o, out_f, n);
  }
}

APGM_INLINE void split_cells(Policy policy, int levels, const float* o, const float* f, float* out_o,
                             float* out_f, std::size_t n) {
  switch (policy) {
    case Policy::kExclusive:
      return split_cells<Policy::kExclusive>(levels, o, f, out_o, out_f, n);
    case Policy::kProduct:
      return split_cells<Policy::kProduct>(levels, o, f, out_o, out_f, n);
    default:
      return split_cells<Policy::kConditional>(levels, o, f, out_o, out_f, n);
  }
}

template <std::size_t kCopies>
APGM_INLINE void spread_row(const float* from, float* __restrict to, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < kCopies; ++k) to[kCopies * i + k] = from[i];
  }
}

APGM_INLINE void spread_row(const float* from, int levels, float* to, std::size_t n) {
  if (levels == 1) return spread_row<2>(from, to, n);
  if (levels == 2) return spread_row<4>(from, to, n);
  const std::size_t eights = std::size_t{1} << (levels - 3);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < 8 * eights; ++k) to[8 * eights * i + k] = from[i];
  }
}

}  // namespace apgm::fuse::loop
