#include "codec_kernels.hpp"

#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>

#include <array>
#include <bit>
#include <cstring>
#endif

namespace apgm::format {

#if defined(__x86_64__) && defined(__GNUC__)
namespace {

// Named function by function: the rest of the library stays at the baseline of the architecture.
#define APGM_AVX2 __attribute__((target("avx2,popcnt")))

using Lanes = std::array<std::uint8_t, 8>;

/// For each mask of eight cells the numbers of those that are set, in order; the rest does not matter.
constexpr std::array<Lanes, 256> compressing_lanes() {
  std::array<Lanes, 256> table{};
  for (unsigned mask = 0; mask < 256; ++mask) {
    std::size_t n = 0;
    for (std::uint8_t k = 0; k < 8; ++k) {
      if ((mask >> k & 1u) != 0) table[mask][n++] = k;
    }
  }
  return table;
}

/// For each mask and cell how many cells before it are set.
constexpr std::array<Lanes, 256> expanding_lanes() {
  std::array<Lanes, 256> table{};
  for (unsigned mask = 0; mask < 256; ++mask) {
    for (unsigned k = 0; k < 8; ++k) {
      table[mask][k] = static_cast<std::uint8_t>(std::popcount(mask & ((1u << k) - 1)));
    }
  }
  return table;
}

constexpr auto kCompress = compressing_lanes();
constexpr auto kExpand = expanding_lanes();

APGM_AVX2 inline __m256i load(const void* from) {
  return _mm256_loadu_si256(static_cast<const __m256i*>(from));
}

APGM_AVX2 inline void store(void* to, __m256i value) {
  _mm256_storeu_si256(static_cast<__m256i*>(to), value);
}

APGM_AVX2 inline __m256i lanes(const Lanes& table) {
  return _mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(table.data())));
}

APGM_AVX2 std::size_t pack(const float* plane, std::size_t cells, std::uint32_t background, std::byte* mask,
                           std::uint32_t* values) {
  const __m256i empty = _mm256_set1_epi32(static_cast<int>(background));
  const std::uint32_t* const start = values;
  std::size_t i = 0;
  for (; i + 8 <= cells; i += 8) {
    const __m256i v = load(plane + i);
    const __m256 same = _mm256_castsi256_ps(_mm256_cmpeq_epi32(v, empty));
    const unsigned bits = static_cast<unsigned>(_mm256_movemask_ps(same)) ^ 0xffu;
    mask[i / 8] = static_cast<std::byte>(bits);
    store(values, _mm256_permutevar8x32_epi32(v, lanes(kCompress[bits])));
    values += _mm_popcnt_u32(bits);
  }
  const auto n = static_cast<std::size_t>(values - start);
  return i == cells ? n : n + plain_kernels().pack(plane + i, cells - i, background, mask + i / 8, values);
}

APGM_AVX2 void scatter(const std::byte* mask, const std::uint32_t* values, std::uint32_t background,
                       float* plane, std::size_t cells) {
  const __m256i empty = _mm256_set1_epi32(static_cast<int>(background));
  const __m256i bit = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
  std::size_t i = 0;
  for (; i + 8 <= cells; i += 8) {
    const auto bits = static_cast<unsigned>(mask[i / 8]);
    const __m256i spread = _mm256_permutevar8x32_epi32(load(values), lanes(kExpand[bits]));
    const __m256i set =
        _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(static_cast<int>(bits)), bit), bit);
    store(plane + i, _mm256_blendv_epi8(empty, spread, set));
    values += _mm_popcnt_u32(bits);
  }
  if (i < cells) plain_kernels().scatter(mask + i / 8, values, background, plane + i, cells - i);
}

APGM_AVX2 std::size_t count_bits(const std::byte* bytes, std::size_t n) {
  std::size_t count = 0, i = 0;
  for (; i + 8 <= n; i += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes + i, sizeof(word));
    count += static_cast<std::size_t>(_mm_popcnt_u64(word));
  }
  return count + plain_kernels().count_bits(bytes + i, n - i);
}

/// Four values in each half: their bytes 0 side by side, then their bytes 1, 2, 3.
APGM_AVX2 inline __m256i group_bytes(__m256i four) {
  return _mm256_shuffle_epi8(four, _mm256_setr_epi8(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15,  //
                                                    0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15));
}

APGM_AVX2 void split(const std::uint32_t* values, std::size_t n, std::byte* planes) {
  // Lanes of four bytes come out as values 0, 8, 16, 24, then 4, 12, 20, 28.
  const __m256i order = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);
  std::byte *p3 = planes, *p2 = p3 + n, *p1 = p2 + n, *p0 = p1 + n;
  std::size_t i = 0;
  for (; i + 32 <= n; i += 32) {
    const __m256i a = group_bytes(load(values + i)), b = group_bytes(load(values + i + 8));
    const __m256i c = group_bytes(load(values + i + 16)), d = group_bytes(load(values + i + 24));
    const __m256i ab_low = _mm256_unpacklo_epi32(a, b), cd_low = _mm256_unpacklo_epi32(c, d);
    const __m256i ab_high = _mm256_unpackhi_epi32(a, b), cd_high = _mm256_unpackhi_epi32(c, d);
    store(p0 + i, _mm256_permutevar8x32_epi32(_mm256_unpacklo_epi64(ab_low, cd_low), order));
    store(p1 + i, _mm256_permutevar8x32_epi32(_mm256_unpackhi_epi64(ab_low, cd_low), order));
    store(p2 + i, _mm256_permutevar8x32_epi32(_mm256_unpacklo_epi64(ab_high, cd_high), order));
    store(p3 + i, _mm256_permutevar8x32_epi32(_mm256_unpackhi_epi64(ab_high, cd_high), order));
  }
  for (; i < n; ++i) {
    p0[i] = static_cast<std::byte>(values[i]);
    p1[i] = static_cast<std::byte>(values[i] >> 8);
    p2[i] = static_cast<std::byte>(values[i] >> 16);
    p3[i] = static_cast<std::byte>(values[i] >> 24);
  }
}

APGM_AVX2 void join(const std::byte* const planes[4], std::size_t n, std::uint32_t* values) {
  std::size_t i = 0;
  for (; i + 32 <= n; i += 32) {
    const __m256i b0 = load(planes[0] + i), b1 = load(planes[1] + i);
    const __m256i b2 = load(planes[2] + i), b3 = load(planes[3] + i);
    const __m256i low_a = _mm256_unpacklo_epi8(b0, b1), low_b = _mm256_unpackhi_epi8(b0, b1);
    const __m256i high_a = _mm256_unpacklo_epi8(b2, b3), high_b = _mm256_unpackhi_epi8(b2, b3);
    // Each holds four values of the first half of 32, and four of the second.
    const __m256i v0 = _mm256_unpacklo_epi16(low_a, high_a), v4 = _mm256_unpackhi_epi16(low_a, high_a);
    const __m256i v8 = _mm256_unpacklo_epi16(low_b, high_b), v12 = _mm256_unpackhi_epi16(low_b, high_b);
    store(values + i, _mm256_permute2x128_si256(v0, v4, 0x20));
    store(values + i + 8, _mm256_permute2x128_si256(v8, v12, 0x20));
    store(values + i + 16, _mm256_permute2x128_si256(v0, v4, 0x31));
    store(values + i + 24, _mm256_permute2x128_si256(v8, v12, 0x31));
  }
  const std::byte* const rest[4] = {planes[0] + i, planes[1] + i, planes[2] + i, planes[3] + i};
  plain_kernels().join(rest, n - i, values + i);
}

/// The four byte planes of up to 16 values fit a register each, and one instruction looks 16 indices up in
/// it.
APGM_AVX2 void look_up_16(const std::byte* indices, std::size_t n, const std::uint32_t* table,
                          std::size_t entries, float* out) {
  alignas(16) std::byte planes[4][16] = {};
  for (std::size_t e = 0; e < entries; ++e) {
    for (std::size_t k = 0; k < 4; ++k) planes[k][e] = static_cast<std::byte>(table[e] >> (8 * k));
  }
  __m128i t[4];
  for (std::size_t k = 0; k < 4; ++k) t[k] = _mm_load_si128(reinterpret_cast<const __m128i*>(planes[k]));
  std::size_t i = 0;
  for (; i + 16 <= n; i += 16) {
    const __m128i index = _mm_loadu_si128(reinterpret_cast<const __m128i*>(indices + i));
    const __m128i b0 = _mm_shuffle_epi8(t[0], index), b1 = _mm_shuffle_epi8(t[1], index);
    const __m128i b2 = _mm_shuffle_epi8(t[2], index), b3 = _mm_shuffle_epi8(t[3], index);
    const __m128i low_a = _mm_unpacklo_epi8(b0, b1), low_b = _mm_unpackhi_epi8(b0, b1);
    const __m128i high_a = _mm_unpacklo_epi8(b2, b3), high_b = _mm_unpackhi_epi8(b2, b3);
    auto* const to = reinterpret_cast<__m128i*>(out + i);
    _mm_storeu_si128(to, _mm_unpacklo_epi16(low_a, high_a));
    _mm_storeu_si128(to + 1, _mm_unpackhi_epi16(low_a, high_a));
    _mm_storeu_si128(to + 2, _mm_unpacklo_epi16(low_b, high_b));
    _mm_storeu_si128(to + 3, _mm_unpackhi_epi16(low_b, high_b));
  }
  plain_kernels().look_up(indices + i, n - i, table, entries, out + i);
}

APGM_AVX2 void look_up(const std::byte* indices, std::size_t n, const std::uint32_t* table,
                       std::size_t entries, float* out) {
  if (entries <= 16) return look_up_16(indices, n, table, entries, out);
  plain_kernels().look_up(indices, n, table, entries, out);
}

APGM_AVX2 bool are_masses(const float* const* planes, std::size_t channels, std::size_t cells, float low,
                          float high) {
  const __m256 lows = _mm256_set1_ps(low), highs = _mm256_set1_ps(high);
  __m256i largest = _mm256_setzero_si256();
  __m256 outside = _mm256_setzero_ps();
  std::size_t i = 0;
  for (; i + 8 <= cells; i += 8) {
    __m256 sum = _mm256_setzero_ps();
    for (std::size_t c = 0; c < channels; ++c) {
      const __m256i v = load(planes[c] + i);
      largest = _mm256_max_epu32(largest, v);
      sum = _mm256_add_ps(sum, _mm256_castsi256_ps(v));
    }
    outside = _mm256_or_ps(outside, _mm256_cmp_ps(sum, highs, _CMP_GT_OQ));
    outside = _mm256_or_ps(outside, _mm256_cmp_ps(sum, lows, _CMP_LT_OQ));
  }
  const __m256i one = _mm256_set1_epi32(0x3f800000);
  const __m256i fits = _mm256_cmpeq_epi32(_mm256_max_epu32(largest, one), one);
  if (_mm256_movemask_epi8(fits) != -1 || _mm256_movemask_ps(outside) != 0) return false;
  if (i == cells) return true;
  std::array<const float*, 16> rest{};
  for (std::size_t c = 0; c < channels; ++c) rest[c] = planes[c] + i;
  return plain_kernels().are_masses(rest.data(), channels, cells - i, low, high);
}

}  // namespace

const Kernels* avx2_kernels() {
  static constexpr Kernels kAvx2{pack, scatter, count_bits, split, join, look_up, are_masses};
  static const bool has = __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("popcnt") != 0;
  return has ? &kAvx2 : nullptr;
}

#else

const Kernels* avx2_kernels() { return nullptr; }

#endif

}  // namespace apgm::format
