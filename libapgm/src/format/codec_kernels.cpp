#include "codec_kernels.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

namespace apgm::format {
namespace {

std::size_t pack(const float* plane, std::size_t cells, std::uint32_t background, std::byte* mask,
                 std::uint32_t* values) {
  const std::uint32_t* const start = values;
  for (std::size_t i = 0; i < cells; i += 8) {
    unsigned bits = 0;
    const std::size_t end = std::min(cells - i, std::size_t{8});
    for (std::size_t k = 0; k < end; ++k) {
      const auto value = std::bit_cast<std::uint32_t>(plane[i + k]);
      const unsigned has = value != background;
      bits |= has << k;
      *values = value;
      values += has;
    }
    mask[i / 8] = static_cast<std::byte>(bits);
  }
  return static_cast<std::size_t>(values - start);
}

void scatter(const std::byte* mask, const std::uint32_t* values, std::uint32_t background, float* plane,
             std::size_t cells) {
  for (std::size_t i = 0; i < cells; i += 8) {
    const auto bits = static_cast<unsigned>(mask[i / 8]);
    const std::size_t end = std::min(cells - i, std::size_t{8});
    for (std::size_t k = 0; k < end; ++k) {
      const unsigned has = bits >> k & 1u;
      plane[i + k] = std::bit_cast<float>(has != 0 ? *values : background);
      values += has;
    }
  }
}

std::size_t count_bits(const std::byte* bytes, std::size_t n) {
  std::size_t count = 0, i = 0;
  for (; i + 8 <= n; i += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes + i, sizeof(word));
    count += static_cast<std::size_t>(std::popcount(word));
  }
  for (; i < n; ++i) count += static_cast<std::size_t>(std::popcount(static_cast<unsigned>(bytes[i])));
  return count;
}

void split(const std::uint32_t* values, std::size_t n, std::byte* planes) {
  for (int k = 3; k >= 0; --k, planes += n) {
    for (std::size_t i = 0; i < n; ++i) planes[i] = static_cast<std::byte>(values[i] >> (8 * k));
  }
}

void join(const std::byte* const planes[4], std::size_t n, std::uint32_t* values) {
  const std::byte *p0 = planes[0], *p1 = planes[1], *p2 = planes[2], *p3 = planes[3];
  const auto at = [](const std::byte* p, std::size_t i) { return static_cast<std::uint32_t>(p[i]); };
  for (std::size_t i = 0; i < n; ++i)
    values[i] = at(p3, i) << 24 | at(p2, i) << 16 | at(p1, i) << 8 | at(p0, i);
}

void look_up(const std::byte* indices, std::size_t n, const std::uint32_t* table, std::size_t /*entries*/,
             float* out) {
  for (std::size_t i = 0; i < n; ++i) {
    out[i] = std::bit_cast<float>(table[static_cast<std::size_t>(indices[i])]);
  }
}

bool are_masses(const float* const* planes, std::size_t channels, std::size_t cells, float low, float high) {
  constexpr std::uint32_t kOne = 0x3f800000;
  int bad = 0;
  for (std::size_t i = 0; i < cells; ++i) {
    float sum = 0;
    for (std::size_t c = 0; c < channels; ++c) {
      // As unsigned numbers all of NaN, infinity, negatives, -0 and values above 1 lie beyond the bits of 1.
      bad |= std::bit_cast<std::uint32_t>(planes[c][i]) > kOne;
      sum += planes[c][i];
    }
    bad |= (sum > high) | (sum < low);
  }
  return bad == 0;
}

}  // namespace

const Kernels& plain_kernels() {
  static constexpr Kernels kPlain{pack, scatter, count_bits, split, join, look_up, are_masses};
  return kPlain;
}

const Kernels& kernels() {
  static const Kernels& chosen = avx2_kernels() != nullptr ? *avx2_kernels() : plain_kernels();
  return chosen;
}

}  // namespace apgm::format
