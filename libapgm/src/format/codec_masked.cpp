#include <algorithm>
#include <bit>
#include <cmath>

#include "codec_body.hpp"

namespace apgm::format {
namespace {

std::size_t mask_bytes(std::size_t cells) { return (cells + 7) / 8; }

std::uint32_t background_bits(const LayerType& type, int channel) {
  return std::bit_cast<std::uint32_t>(type.background(channel));
}

/// True if the bytes look like noise: their histogram is as flat as chance makes it.
bool is_noise(Bytes bytes) {
  const std::size_t n = bytes.size();
  if (n < 1024) return false;
  // Four histograms, so that equal bytes in a row do not wait for each other.
  std::array<std::array<std::uint32_t, 256>, 4> count{};
  std::size_t i = 0;
  for (; i + 8 <= n; i += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + i, sizeof(word));
    for (std::size_t k = 0; k < 8; ++k, word >>= 8) ++count[k % 4][word & 0xff];
  }
  for (; i < n; ++i) ++count[0][static_cast<std::size_t>(bytes[i])];
  std::uint64_t squares = 0;
  for (std::size_t b = 0; b < 256; ++b) {
    const std::uint64_t c = count[0][b] + count[1][b] + count[2][b] + count[3][b];
    squares += c * c;
  }
  // For uniform bytes the expected sum of squares is n + n (n - 1) / 256.
  const std::uint64_t m = n;
  return squares * 25'600 <= m * m * 104 + 25'600 * m;
}

/// The first values whose number of distinct ones counts.
constexpr std::size_t kSample = 4096;

/// True if most of up to kSample values differ from each other, told fast; false: not known.
bool mostly_distinct(std::span<const std::uint32_t> values) {
  std::array<std::uint64_t, 1024> seen{};  // a bit for each of 2^16 hashes
  std::size_t again = 0;                   // at least as often as a value comes back
  for (const std::uint32_t v : values) {
    const std::uint32_t h = v * 0x9e3779b1u >> 16;
    std::uint64_t& word = seen[h >> 6];
    again += word >> (h & 63) & 1u;
    word |= std::uint64_t{1} << (h & 63);
  }
  return again * 8 <= values.size();
}

/// True if whole values come back: then even noisy low bytes hold repeats that zstd finds.
bool repeats(std::span<const std::uint32_t> values) {
  values = values.first(std::min(values.size(), kSample));
  if (mostly_distinct(values)) return false;
  std::array<std::uint32_t, kSample> sample;
  const auto end = std::ranges::copy(values, sample.begin()).out;
  std::sort(sample.begin(), end);
  const auto distinct = std::unique(sample.begin(), end) - sample.begin();
  return static_cast<std::size_t>(distinct) * 8 < values.size() * 7;
}

/// Low planes of float32 values that are noise, 0..2.
/// @param planes  the four of `n` values, the highest first
int noisy_planes(Bytes planes, std::size_t n) {
  int noisy = 0;
  while (noisy < 2 && is_noise(planes.subspan(static_cast<std::size_t>(3 - noisy) * n, n))) ++noisy;
  return noisy;
}

std::uint32_t quantum(float value, std::uint32_t levels) {
  return static_cast<std::uint32_t>(std::lrint(static_cast<double>(value) * levels));
}

/// Whole numbers of 1/levels become the bits of their float32 quotient.
void to_masses(float levels, std::span<std::uint32_t> values) {
  for (auto& v : values) v = std::bit_cast<std::uint32_t>(static_cast<float>(v) / levels);
}

std::size_t count_bits(Bytes mask, std::size_t cells) {
  if (cells % 8 != 0 && (static_cast<unsigned>(mask.back()) >> (cells % 8)) != 0)
    fail_body("a mask has bits beyond its cells");
  return kernels().count_bits(mask.data(), mask.size());
}

}  // namespace

void try_masked(const Layer& layer, const LayerType& type, int level, Lossy lossy, StoredLayer& best) {
  Scratch& s = scratch();
  const auto channels = static_cast<std::size_t>(layer.channels());
  const std::size_t cells = layer.cells();
  const std::size_t masks = channels * mask_bytes(cells);
  // Masks, then byte planes, the highest first: so a frame and the planes kept raw are its two ends.
  const std::span<std::byte> content = s.content.fit(masks + channels * cells * 4);
  std::uint32_t* const values = s.values.fit(channels * cells + Kernels::kSlack).data();
  std::array<std::uint32_t, kMaxChannels + 1> counts{};
  std::size_t n = 0;
  for (std::size_t c = 0; c < channels; ++c) {
    const int channel = static_cast<int>(c);
    const std::size_t count =
        kernels().pack(layer.plane(channel).data(), cells, background_bits(type, channel),
                       content.data() + c * mask_bytes(cells), values + n);
    counts[c] = static_cast<std::uint32_t>(count);
    n += count;
  }
  const auto keep = [&](Encoding encoding, std::size_t width, int raw_planes) {
    counts[channels] = static_cast<std::uint32_t>(raw_planes);
    const Bytes all = content.first(masks + n * width);
    const std::size_t raw = n * static_cast<std::size_t>(raw_planes);
    keep_smaller(encoding, std::span(counts).first(channels + 1), true, all.first(all.size() - raw),
                 all.last(raw), level, best);
  };
  if (lossy != Lossy::kNone && type.is_evidence()) {
    const bool narrow = lossy == Lossy::kU8;
    for (std::size_t i = 0; i < n; ++i)
      values[i] = quantum(std::bit_cast<float>(values[i]), narrow ? 255 : 65535);
    if (!narrow) write_plane(values, n, 1, content.data() + masks);
    write_plane(values, n, 0, content.data() + masks + (narrow ? 0 : n));
    return keep(narrow ? Encoding::kMasked8 : Encoding::kMasked16, narrow ? 1 : 2, 0);
  }
  kernels().split(values, n, content.data() + masks);
  const int noisy = noisy_planes(content.subspan(masks), n);
  keep(Encoding::kMasked32, 4, noisy);
  if (noisy > 0 && repeats({values, n})) keep(Encoding::kMasked32, 4, 0);
}

void decode_masked(Bytes body, int width, const LayerType& type, Layer& out) {
  BodyReader reader(body);
  const auto channels = static_cast<std::size_t>(out.channels());
  const std::size_t cells = out.cells();
  std::array<std::uint32_t, kMaxChannels> counts{};
  std::size_t n = 0;
  for (std::size_t c = 0; c < channels; ++c) {
    counts[c] = reader.take<std::uint32_t>();
    if (counts[c] > cells) fail_body("a layer holds more values than cells");
    n += counts[c];
  }
  const auto raw_planes = reader.take<std::uint32_t>();
  if (raw_planes > (width == 4 ? 2u : 0u))
    fail_body("a layer keeps more raw planes than its encoding allows");
  const Bytes frame = reader.take_bytes(reader.take<std::uint32_t>());
  const Bytes low = reader.take_bytes(n * raw_planes);
  reader.expect_end();
  Scratch& s = scratch();
  const std::size_t masks = channels * mask_bytes(cells);
  const std::span<std::byte> content =
      s.content.fit(masks + n * (static_cast<std::size_t>(width) - raw_planes));
  read_frame(frame, content);
  std::uint32_t* values = s.values.fit(n + Kernels::kSlack).data();
  join_planes(content.subspan(masks), low, n, width, static_cast<int>(raw_planes), values);
  if (width < 4) to_masses(width == 1 ? 255.0f : 65535.0f, {values, n});
  for (std::size_t c = 0; c < channels; ++c) {
    const Bytes mask = content.subspan(c * mask_bytes(cells), mask_bytes(cells));
    if (count_bits(mask, cells) != counts[c]) fail_body("a mask does not fit the number of its values");
    const int channel = static_cast<int>(c);
    kernels().scatter(mask.data(), values, background_bits(type, channel), out.plane(channel).data(), cells);
    values += counts[c];
  }
}

}  // namespace apgm::format
