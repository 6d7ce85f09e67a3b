#pragma once

#include <cstddef>
#include <cstdint>

namespace apgm::format {

/// The inner loops of the codec: once in plain C++, and for machines that have AVX2 in its instructions.
/// Guarantee: the same results, bit by bit, from every set of them.
struct Kernels {
  /// Values that `pack` and `scatter` may touch beyond those that count.
  static constexpr std::size_t kSlack = 8;

  /// Sets bit i % 8 of mask[i / 8] where plane[i] has not the bits of `background`, and puts the bits of
  /// these cells into `values`, which has room for `cells` + kSlack. Bits beyond `cells` are zero.
  /// @return  how many
  std::size_t (*pack)(const float* plane, std::size_t cells, std::uint32_t background, std::byte* mask,
                      std::uint32_t* values);
  /// The inverse: cells take the next of `values` where their bit is set, else `background`. `values` holds
  /// as many as there are bits, and kSlack that are not used.
  void (*scatter)(const std::byte* mask, const std::uint32_t* values, std::uint32_t background, float* plane,
                  std::size_t cells);
  /// Set bits of `n` bytes.
  std::size_t (*count_bits)(const std::byte* bytes, std::size_t n);
  /// Byte planes 3, 2, 1, 0 of n values, one after the other.
  void (*split)(const std::uint32_t* values, std::size_t n, std::byte* planes);
  /// The inverse, of planes that may lie anywhere: planes[k] holds byte k.
  void (*join)(const std::byte* const planes[4], std::size_t n, std::uint32_t* values);
  /// out[i] = table[indices[i]]; all indices are below `entries`.
  void (*look_up)(const std::byte* indices, std::size_t n, const std::uint32_t* table, std::size_t entries,
                  float* out);
  /// True if all masses lie in [0, 1], none is -0, and the sum of each cell, added in channel order, lies in
  /// [low, high].
  bool (*are_masses)(const float* const* planes, std::size_t channels, std::size_t cells, float low,
                     float high);
};

/// Those for this machine.
const Kernels& kernels();

const Kernels& plain_kernels();
/// nullptr where they were not compiled or the machine has no AVX2.
const Kernels* avx2_kernels();

}  // namespace apgm::format
