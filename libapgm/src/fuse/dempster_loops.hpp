#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "fuse/belief.hpp"
#include "fuse/combine_kernels.hpp"

/// Dempster's rule of two occupancy layers, inlined into each clone (and into the tests, which compare the
/// clones with it).
///
/// What bounds it in cache is the number of its operations, not the two divisions. So there are two loops
/// with the same bits: one for any cells, and one for blocks of plain cells, which leaves out the blends,
/// clamps and counts that only the others need (three quarters of the time).
namespace apgm::fuse::loop {

/// Where the cells of a block are read and written.
struct DempsterBlock {
  OccupancyPlanes a, b;
  OccupancyOut out;
  float* k = nullptr;

  APGM_INLINE DempsterBlock from(std::size_t i) const {
    return {{a.o + i, a.f + i}, {b.o + i, b.f + i}, {out.o + i, out.f + i}, k == nullptr ? k : k + i};
  }
};

/// Any cells; `out` may be an input.
/// @return cells of total conflict
template <bool kConflict>
APGM_INLINE std::uint32_t dempster_any(const DempsterBlock& at, std::size_t cells) {
  const DempsterBlock p = at;
  std::uint32_t dead = 0;
  APGM_IVDEP
  for (std::size_t i = 0; i < cells; ++i) {
    const Occupancy x = occupancy(p.a.o[i], p.a.f[i]);
    const Occupancy y = occupancy(p.b.o[i], p.b.f[i]);
    const Conjunction both = conjoin(x, y);
    const Occupancy z = bounded(dempster(both));
    if constexpr (kConflict) p.k[i] = conflict(x, y);
    const bool x_holds = (x.o != 0.0f) | (x.f != 0.0f);
    const bool y_holds = (y.o != 0.0f) | (y.f != 0.0f);
    dead += both.sum == 0.0f ? 1u : 0u;
    const float o = y_holds ? z.o : x.o;
    const float f = y_holds ? z.f : x.f;
    p.out.o[i] = x_holds ? o : y.o;
    p.out.f[i] = x_holds ? f : y.f;
  }
  return dead;
}

/// Two masses by their bits, which have the order of the numbers. Processors that compare floats in the units
/// that add them order whole numbers in others, at the same time.
struct Ordered {
  float greater = 0;
  float lesser = 0;
};
APGM_INLINE Ordered ordered(float a, float b) {
  const auto p = std::bit_cast<std::int32_t>(a), q = std::bit_cast<std::int32_t>(b);
  const std::int32_t greater = std::max(p, q);
  return {std::bit_cast<float>(greater), std::bit_cast<float>(p ^ q ^ greater)};
}

/// whole - o - f as occupancy() makes it, but below 0 where the masses sum to more than `whole`.
APGM_INLINE float omega_or_excess(float o, float f, float whole) {
  const Ordered m = ordered(o, f);
  const float sum = o + f;
  return (whole - sum) - (m.lesser - (sum - m.greater));
}

/// The bits of dempster_any() if all cells are plain: masses that sum to no more than 1, and no total
/// conflict. No output may be an input.
///
/// A plain cell needs no choice where one input is vacuous. The unnormalised masses are then the masses m of
/// the other times the scale, and their float32 sum is the scale itself: m(Omega) is 1 - m(O) - m(F) rounded
/// once where m(O) + m(F) >= .5, so that the sum lies within 2^-25 of 1, and 1 - 2^-25 is a tie that goes to
/// 1. Division by the scale gives the bits of m back, and m(F) <= 1 - m(O) holds in float32 if it holds at
/// all.
/// @return false if a cell was not plain; the outputs are then of no use
template <bool kConflict>
APGM_INLINE bool dempster_plain(const DempsterBlock& at, std::size_t cells) {
  const float *const ao = at.a.o, *const af = at.a.f, *const bo = at.b.o, *const bf = at.b.f;
  float* __restrict const to_o = at.out.o, * __restrict const to_f = at.out.f, * __restrict const k = at.k;
  std::int32_t omegas = 0, masses = 0;
  APGM_IVDEP
  for (std::size_t i = 0; i < cells; ++i) {
    // The scale is a power of two: it goes through all of this without a rounding.
    const float xo = ao[i] * kProductScale, xf = af[i] * kProductScale, yo = bo[i], yf = bf[i];
    const float xu = omega_or_excess(xo, xf, kProductScale), yu = omega_or_excess(yo, yf, 1.0f);
    const Conjunction both = conjoin_scaled({xo, xf, xu}, {yo, yf, yu});
    const float o = both.o / both.sum, f = both.f / both.sum;
    to_o[i] = o;
    const float most = 1.0f - o;
    to_f[i] = f < most ? f : most;
    if constexpr (kConflict) k[i] = conflict({ao[i], af[i], 0}, {yo, yf, 0});
    omegas |= std::bit_cast<std::int32_t>(xu) | std::bit_cast<std::int32_t>(yu);
    masses |= std::bit_cast<std::int32_t>(o);
  }
  // A sign is an excess. Masses lie below 2: no sign, and not the highest bit of the exponent, which 0 / 0
  // has.
  return omegas >= 0 && (static_cast<std::uint32_t>(masses) & 0xc0000000u) == 0;
}

/// Cells of a block: its inputs and outputs stay in the first-level cache until it is known to be plain.
inline constexpr std::size_t kPlainBlock = 256;

/// True if writing `out` may change what is still to be read.
inline bool overlaps(const DempsterBlock& at, std::size_t cells) {
  const auto begin = [](const float* p) { return reinterpret_cast<std::uintptr_t>(p); };
  const std::uintptr_t bytes = cells * sizeof(float);
  for (const float* out : {at.out.o, at.out.f}) {
    for (const float* in : {at.a.o, at.a.f, at.b.o, at.b.f}) {
      if (begin(out) < begin(in) + bytes && begin(in) < begin(out) + bytes) return true;
    }
  }
  return false;
}

template <bool kConflict>
APGM_INLINE std::uint64_t dempster_two(const DempsterBlock& all, std::size_t cells) {
  const bool in_place = overlaps(all, cells);
  alignas(64) std::array<std::array<float, kPlainBlock>, 2> aside;
  std::uint64_t total = 0;
  std::size_t i = 0, skip = 0, pause = 0;
  for (; i + kPlainBlock <= cells; i += kPlainBlock) {
    const DempsterBlock block = all.from(i);
    if (skip == 0) {
      DempsterBlock to = block;
      if (in_place) to.out = {aside[0].data(), aside[1].data()};
      if (dempster_plain<kConflict>(to, kPlainBlock)) {
        if (in_place) {
          std::memcpy(block.out.o, to.out.o, sizeof aside[0]);
          std::memcpy(block.out.f, to.out.f, sizeof aside[1]);
        }
        pause = 0;
        continue;
      }
      // Layers full of such cells shall not pay for both loops.
      pause = pause < 32 ? 4 * pause + 7 : pause;
      skip = pause;
    } else {
      --skip;
    }
    total += dempster_any<kConflict>(block, kPlainBlock);
  }
  return total + dempster_any<kConflict>(all.from(i), cells - i);
}

}  // namespace apgm::fuse::loop
