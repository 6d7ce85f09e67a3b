#include <algorithm>
#include <bit>
#include <numeric>

#include "codec_body.hpp"

namespace apgm::format {
namespace {

/// Distinct tuples of a layer in order of appearance, and each cell's index; false if there are too many to
/// help.
bool find_tuples(const Layer& layer, Scratch& s) {
  constexpr std::size_t kSlots = 4 * kMaxPalette;
  constexpr std::uint16_t kFree = 0xffff;
  const auto channels = static_cast<std::size_t>(layer.channels());
  const std::size_t cells = layer.cells();
  s.slots.assign(kSlots, kFree);
  s.tuples.clear();
  s.indices.resize(cells);
  std::array<const float*, kMaxChannels> planes{};
  for (std::size_t c = 0; c < channels; ++c) planes[c] = layer.plane(static_cast<int>(c)).data();
  std::array<std::uint32_t, kMaxChannels> tuple{};
  std::size_t distinct = 0, fresh = 0;
  for (std::size_t i = 0; i < cells; ++i) {
    std::uint64_t h = 0;
    bool same = i > 0;
    for (std::size_t c = 0; c < channels; ++c) {
      const auto bits = std::bit_cast<std::uint32_t>(planes[c][i]);
      same = same && bits == tuple[c];
      tuple[c] = bits;
      h = (h ^ bits) * 0x9e3779b97f4a7c15u;
      h ^= h >> 29;
    }
    if (same) {  // runs are common
      s.indices[i] = s.indices[i - 1];
      continue;
    }
    ++fresh;
    std::size_t slot = h & (kSlots - 1);
    const auto differs = [&] {
      return !std::equal(tuple.begin(), tuple.begin() + static_cast<std::ptrdiff_t>(channels),
                         s.tuples.begin() + static_cast<std::ptrdiff_t>(s.slots[slot] * channels));
    };
    while (s.slots[slot] != kFree && differs()) slot = (slot + 1) & (kSlots - 1);
    if (s.slots[slot] == kFree) {
      // Mostly new tuples: no palette will pay.
      if (distinct == kMaxPalette || (distinct >= 512 && distinct * 2 > fresh)) return false;
      s.slots[slot] = static_cast<std::uint16_t>(distinct++);
      for (std::size_t c = 0; c < channels; ++c) s.tuples.push_back(tuple[c]);
    }
    s.indices[i] = s.slots[slot];
  }
  return true;
}

/// Sorts the tuples, so that equal layers have equal bytes whatever their cells' order of discovery.
void sort_tuples(std::size_t channels, Scratch& s) {
  const std::size_t n = s.tuples.size() / channels;
  std::vector<std::uint16_t> order(n), rank(n);
  std::iota(order.begin(), order.end(), std::uint16_t{0});
  const auto tuple = [&](std::uint16_t i) { return std::span(s.tuples).subspan(i * channels, channels); };
  std::sort(order.begin(), order.end(), [&](std::uint16_t a, std::uint16_t b) {
    return std::ranges::lexicographical_compare(tuple(a), tuple(b));
  });
  std::vector<std::uint32_t> sorted;
  sorted.reserve(s.tuples.size());
  for (std::size_t i = 0; i < n; ++i) {
    rank[order[i]] = static_cast<std::uint16_t>(i);
    const auto t = tuple(order[i]);
    for (const std::uint32_t value : t) sorted.push_back(value);
  }
  s.tuples.swap(sorted);
  for (auto& i : s.indices) i = rank[i];
}

}  // namespace

void try_palette(const Layer& layer, int level, StoredLayer& best) {
  Scratch& s = scratch();
  const auto channels = static_cast<std::size_t>(layer.channels());
  if (!find_tuples(layer, s)) return;
  sort_tuples(channels, s);
  const std::size_t n = s.tuples.size() / channels;
  const int index_bytes = n > 256 ? 2 : 1;
  const std::size_t tuple_bytes = s.tuples.size() * 4;
  s.content.resize(tuple_bytes + s.indices.size() * static_cast<std::size_t>(index_bytes));
  std::byte* at = s.content.data();
  for (int k = 3; k >= 0; --k, at += s.tuples.size()) write_plane(s.tuples.data(), s.tuples.size(), k, at);
  for (int k = index_bytes - 1; k >= 0; --k, at += s.indices.size()) {
    write_plane(s.indices.data(), s.indices.size(), k, at);
  }
  s.candidate.clear();
  append_value(s.candidate, static_cast<std::uint32_t>(n));
  append_frame(s.candidate, s.content, level);
  keep_smaller(Encoding::kPalette, s.candidate, best);
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
  s.content.resize(values * 4 + cells * index_bytes);
  read_frame(body.subspan(sizeof(std::uint32_t)), s.content);
  join_planes(Bytes(s.content).first(values * 4), {}, values, 4, 0, s.tuples);
  const std::byte* high = s.content.data() + values * 4;
  const std::byte* low = high + (index_bytes - 1) * cells;
  s.indices.resize(cells);
  std::uint16_t largest = 0;
  for (std::size_t i = 0; i < cells; ++i) {
    const unsigned hi = index_bytes == 2 ? static_cast<unsigned>(high[i]) << 8 : 0u;
    s.indices[i] = static_cast<std::uint16_t>(hi | static_cast<unsigned>(low[i]));
    largest = std::max(largest, s.indices[i]);
  }
  if (largest >= n) fail_body("a palette index is out of range");
  for (std::size_t c = 0; c < channels; ++c) {
    float* plane = out.plane(static_cast<int>(c)).data();
    for (std::size_t i = 0; i < cells; ++i)
      plane[i] = std::bit_cast<float>(s.tuples[s.indices[i] * channels + c]);
  }
}

}  // namespace apgm::format
