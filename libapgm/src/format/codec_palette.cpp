#include <algorithm>
#include <bit>
#include <numeric>

#include "codec_body.hpp"

namespace apgm::format {
namespace {

constexpr int kSlotBits = 14;
constexpr std::size_t kSlots = std::size_t{1} << kSlotBits;
static_assert(kSlots == 4 * kMaxPalette);
constexpr std::uint64_t kMix = 0x9e3779b97f4a7c15u;
constexpr std::uint16_t kFree = 0xffff;

/// How many cells from `i` on, in eights, hold the tuple of cell i - 1.
std::size_t run_length(std::span<const float* const> planes, std::size_t i, std::size_t cells) {
  const std::size_t start = i;
  for (; i + 8 <= cells; i += 8) {
    std::uint32_t differs = 0;
    for (const float* plane : planes) {
      const auto before = std::bit_cast<std::uint32_t>(plane[i - 1]);
      for (std::size_t k = 0; k < 8; ++k) differs |= std::bit_cast<std::uint32_t>(plane[i + k]) ^ before;
    }
    if (differs != 0) break;
  }
  return i - start;
}

/// Finds the distinct tuples of a layer in order of appearance, and each cell's index.
/// @tparam kChannels  of the layer; 0: any number
/// @return  how many tuples; 0: too many to help
template <std::size_t kChannels>
std::size_t find_tuples(const Layer& layer, Scratch& s) {
  const std::size_t channels = kChannels != 0 ? kChannels : static_cast<std::size_t>(layer.channels());
  const std::size_t cells = layer.cells();
  std::uint16_t* const slots = s.slots.fit(kSlots).data();
  std::uint32_t* const tuples = s.tuples.fit(kMaxPalette * channels).data();
  std::uint16_t* const indices = s.indices.fit(cells).data();
  std::fill_n(slots, kSlots, kFree);
  std::array<const float*, kMaxChannels> planes{};
  for (std::size_t c = 0; c < channels; ++c) planes[c] = layer.plane(static_cast<int>(c)).data();
  std::array<std::uint32_t, kChannels != 0 ? kChannels : kMaxChannels> tuple{};
  std::size_t distinct = 0, fresh = 0;
  for (std::size_t i = 0; i < cells; ++i) {
    if (i % 8 == 0 && i > 0) {
      const std::size_t run = run_length(std::span(planes).first(channels), i, cells);
      std::fill_n(indices + i, run, indices[i - 1]);
      i += run;
      if (i == cells) break;
    }
    std::uint64_t h = 0;
    std::uint32_t differs = i == 0;
    for (std::size_t c = 0; c < channels; ++c) {
      const auto bits = std::bit_cast<std::uint32_t>(planes[c][i]);
      differs |= bits ^ tuple[c];
      tuple[c] = bits;
      h = (kChannels == 0 ? h : h << 32) ^ bits;
      if (kChannels == 0) h *= kMix;
    }
    fresh += differs != 0;  // runs are common, but where they end cannot be foretold
    std::size_t slot = (kChannels == 0 ? h : h * kMix) >> (64 - kSlotBits);
    const auto other = [&] {
      std::uint32_t bits = 0;
      for (std::size_t c = 0; c < channels; ++c) bits |= tuple[c] ^ tuples[slots[slot] * channels + c];
      return bits != 0;
    };
    while (slots[slot] != kFree && other()) slot = (slot + 1) & (kSlots - 1);
    if (slots[slot] == kFree) {
      // Mostly new tuples: no palette will pay.
      if (distinct == kMaxPalette || (distinct >= 512 && distinct * 2 > fresh)) return 0;
      std::copy_n(tuple.begin(), channels, tuples + distinct * channels);
      slots[slot] = static_cast<std::uint16_t>(distinct++);
    }
    indices[i] = slots[slot];
  }
  return distinct;
}

std::size_t find_tuples(const Layer& layer, Scratch& s) {
  switch (layer.channels()) {
    case 1:
      return find_tuples<1>(layer, s);
    case 2:
      return find_tuples<2>(layer, s);
    default:
      return find_tuples<0>(layer, s);
  }
}

/// Sorts the `n` tuples, so that equal layers have equal bytes whatever their cells' order of discovery.
/// Returns the new place of each.
std::vector<std::uint16_t> sort_tuples(std::size_t n, std::size_t channels, Scratch& s) {
  std::uint32_t* const tuples = s.tuples.fit(n * channels).data();
  std::vector<std::uint16_t> order(n), rank(n);
  std::iota(order.begin(), order.end(), std::uint16_t{0});
  const auto tuple = [&](std::uint16_t i) { return std::span(tuples + i * channels, channels); };
  std::sort(order.begin(), order.end(), [&](std::uint16_t a, std::uint16_t b) {
    return std::ranges::lexicographical_compare(tuple(a), tuple(b));
  });
  std::vector<std::uint32_t> sorted;
  sorted.reserve(n * channels);
  for (std::size_t i = 0; i < n; ++i) {
    rank[order[i]] = static_cast<std::uint16_t>(i);
    const auto t = tuple(order[i]);
    sorted.insert(sorted.end(), t.begin(), t.end());
  }
  std::ranges::copy(sorted, tuples);
  return rank;
}

std::size_t largest_of(Bytes indices) {
  unsigned char largest = 0;
  for (const std::byte b : indices) largest = std::max(largest, static_cast<unsigned char>(b));
  return largest;
}

/// Indices of two bytes, all the high ones first. Returns the largest.
std::size_t join_indices(Bytes planes, std::uint16_t* out) {
  const std::size_t n = planes.size() / 2;
  std::uint16_t largest = 0;
  for (std::size_t i = 0; i < n; ++i) {
    out[i] = static_cast<std::uint16_t>(static_cast<unsigned>(planes[i]) << 8 |
                                        static_cast<unsigned>(planes[n + i]));
    largest = std::max(largest, out[i]);
  }
  return largest;
}

}  // namespace

void try_palette(const Layer& layer, int level, StoredLayer& best) {
  Scratch& s = scratch();
  const auto channels = static_cast<std::size_t>(layer.channels());
  const std::size_t cells = layer.cells();
  const std::size_t n = find_tuples(layer, s);
  if (n == 0) return;
  const std::vector<std::uint16_t> rank = sort_tuples(n, channels, s);
  const std::size_t index_bytes = n > 256 ? 2 : 1;
  const std::size_t values = n * channels;
  const std::span<std::byte> content = s.content.fit(values * 4 + cells * index_bytes);
  kernels().split(s.tuples.fit(values).data(), values, content.data());
  std::byte* const high = content.data() + values * 4;
  std::byte* const low = high + (index_bytes - 1) * cells;
  const std::uint16_t* const indices = s.indices.fit(cells).data();
  for (std::size_t i = 0; i < cells; ++i) low[i] = static_cast<std::byte>(rank[indices[i]]);
  if (index_bytes == 2) {
    for (std::size_t i = 0; i < cells; ++i) high[i] = static_cast<std::byte>(rank[indices[i]] >> 8);
  }
  const auto head = static_cast<std::uint32_t>(n);
  keep_smaller(Encoding::kPalette, {&head, 1}, false, content, {}, level, best);
}

void decode_palette(Bytes body, Layer& out) {
  BodyReader reader(body);
  const auto channels = static_cast<std::size_t>(out.channels());
  const std::size_t cells = out.cells();
  const auto n = reader.take<std::uint32_t>();
  if (n < 1 || n > kMaxPalette) fail_body("a palette holds no tuple or more than 4096");
  const std::size_t values = n * channels;
  const std::size_t index_bytes = n > 256 ? 2 : 1;
  Scratch& s = scratch();
  const std::span<std::byte> content = s.content.fit(values * 4 + cells * index_bytes);
  read_frame(body.subspan(sizeof(std::uint32_t)), content);
  std::uint32_t* const tuples = s.tuples.fit(2 * values).data();
  std::uint32_t* const tables = tuples + values;  // channel after channel
  join_planes(content.first(values * 4), {}, values, 4, 0, tuples);
  for (std::size_t c = 0; c < channels; ++c) {
    for (std::size_t t = 0; t < n; ++t) tables[c * n + t] = tuples[t * channels + c];
  }
  const Bytes indices = content.subspan(values * 4);
  if (index_bytes == 1) {
    if (largest_of(indices) >= n) fail_body("a palette index is out of range");
    for (std::size_t c = 0; c < channels; ++c) {
      kernels().look_up(indices.data(), cells, tables + c * n, n, out.plane(static_cast<int>(c)).data());
    }
    return;
  }
  std::uint16_t* const wide = s.indices.fit(cells).data();
  if (join_indices(indices, wide) >= n) fail_body("a palette index is out of range");
  for (std::size_t c = 0; c < channels; ++c) {
    float* const plane = out.plane(static_cast<int>(c)).data();
    const std::uint32_t* const table = tables + c * n;
    for (std::size_t i = 0; i < cells; ++i) plane[i] = std::bit_cast<float>(table[wide[i]]);
  }
}

}  // namespace apgm::format
