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
bool is_noise(const std::byte* bytes, std::size_t n) {
  if (n < 1024) return false;
  std::array<std::uint32_t, 256> count{};
  for (std::size_t i = 0; i < n; ++i) ++count[static_cast<std::size_t>(bytes[i])];
  std::uint64_t squares = 0;
  for (const std::uint64_t c : count) squares += c * c;
  // For uniform bytes the expected sum of squares is n + n (n - 1) / 256.
  const std::uint64_t m = n;
  return squares * 25'600 <= m * m * 104 + 25'600 * m;
}

/// True if whole values come back: then even noisy low bytes hold repeats that zstd finds.
bool repeats(const std::vector<std::uint32_t>& values) {
  std::array<std::uint32_t, 4096> sample{};
  const std::size_t n = std::min(values.size(), sample.size());
  std::copy_n(values.begin(), n, sample.begin());
  std::sort(sample.begin(), sample.begin() + static_cast<std::ptrdiff_t>(n));
  const auto distinct =
      std::unique(sample.begin(), sample.begin() + static_cast<std::ptrdiff_t>(n)) - sample.begin();
  return static_cast<std::size_t>(distinct) * 8 < n * 7;
}

/// Appends the mask of cells with data to `masks` and their values to `values`. Returns how many.
std::uint32_t pack_channel(std::span<const float> plane, std::uint32_t background,
                           std::vector<std::byte>& masks, std::vector<std::uint32_t>& values) {
  const std::size_t start = values.size();
  const std::size_t mask_start = masks.size();
  const std::size_t cells = plane.size();
  values.resize(start + cells);
  masks.resize(mask_start + mask_bytes(cells));
  std::uint32_t* out = values.data() + start;
  for (std::size_t i = 0; i < cells; i += 8) {
    unsigned mask = 0;
    const std::size_t end = std::min(cells - i, std::size_t{8});
    for (std::size_t k = 0; k < end; ++k) {
      const auto bits = std::bit_cast<std::uint32_t>(plane[i + k]);
      const unsigned has = bits != background;
      mask |= has << k;
      *out = bits;
      out += has;
    }
    masks[mask_start + i / 8] = static_cast<std::byte>(mask);
  }
  const auto count = static_cast<std::size_t>(out - (values.data() + start));
  values.resize(start + count);
  return static_cast<std::uint32_t>(count);
}

/// Body of a masked encoding: counts, width, planes kept raw, frame size | frame: masks, high planes | raw
/// low planes.
void build_masked(std::span<const std::uint32_t> counts, Bytes masks,
                  const std::vector<std::uint32_t>& values, int width, int raw_planes, int level,
                  std::vector<std::byte>& content, std::vector<std::byte>& out) {
  const std::size_t n = values.size();
  out.clear();
  for (const std::uint32_t count : counts) append_value(out, count);
  append_value(out, static_cast<std::uint32_t>(raw_planes));
  const std::size_t frame_size_at = out.size();
  append_value(out, std::uint32_t{0});
  content.assign(masks.begin(), masks.end());
  content.resize(masks.size() + n * static_cast<std::size_t>(width - raw_planes));
  std::byte* plane = content.data() + masks.size();
  for (int k = width - 1; k >= raw_planes; --k, plane += n) write_plane(values.data(), n, k, plane);
  const auto frame_bytes = static_cast<std::uint32_t>(append_frame(out, content, level));
  std::memcpy(out.data() + frame_size_at, &frame_bytes, sizeof(frame_bytes));
  for (int k = raw_planes - 1; k >= 0; --k) {
    const std::size_t at = out.size();
    out.resize(at + n);
    write_plane(values.data(), n, k, out.data() + at);
  }
}

/// Low planes of float32 values that are noise, 0..2.
int noisy_planes(const std::vector<std::uint32_t>& values) {
  std::vector<std::byte>& plane = scratch().candidate;
  plane.resize(values.size());
  int noisy = 0;
  for (; noisy < 2; ++noisy) {
    write_plane(values.data(), values.size(), noisy, plane.data());
    if (!is_noise(plane.data(), plane.size())) break;
  }
  return noisy;
}

std::uint32_t quantum(float value, std::uint32_t levels) {
  return static_cast<std::uint32_t>(std::lrint(static_cast<double>(value) * levels));
}

/// Whole numbers of 1/levels become the bits of their float32 quotient.
void to_masses(float levels, std::vector<std::uint32_t>& values) {
  for (auto& v : values) v = std::bit_cast<std::uint32_t>(static_cast<float>(v) / levels);
}

/// Writes `values` into the cells whose mask bit is set. The number of set bits must be `values.size()`.
void scatter(Bytes mask, std::span<const std::uint32_t> values, float background, std::span<float> plane) {
  std::ranges::fill(plane, background);
  const std::uint32_t* v = values.data();
  const std::size_t whole = plane.size() / 8;
  for (std::size_t i = 0; i < whole; ++i) {
    auto bits = static_cast<unsigned>(mask[i]);
    float* out = plane.data() + i * 8;
    if (bits == 0xff) {
      std::memcpy(out, v, 8 * sizeof(float));
      v += 8;
      continue;
    }
    for (; bits != 0; bits &= bits - 1) out[std::countr_zero(bits)] = std::bit_cast<float>(*v++);
  }
  if (whole * 8 < plane.size()) {  // a layer of 1 or 4 cells
    for (auto bits = static_cast<unsigned>(mask[whole]); bits != 0; bits &= bits - 1) {
      plane[whole * 8 + static_cast<std::size_t>(std::countr_zero(bits))] = std::bit_cast<float>(*v++);
    }
  }
}

std::size_t count_bits(Bytes mask, std::size_t cells) {
  std::size_t count = 0;
  for (const std::byte b : mask) count += static_cast<std::size_t>(std::popcount(static_cast<unsigned>(b)));
  if (cells % 8 != 0 && (static_cast<unsigned>(mask.back()) >> (cells % 8)) != 0)
    fail_body("a mask has bits beyond its cells");
  return count;
}

}  // namespace

void try_masked(const Layer& layer, const LayerType& type, int level, Lossy lossy, StoredLayer& best) {
  Scratch& s = scratch();
  std::vector<std::byte> masks;
  s.values.clear();
  std::array<std::uint32_t, kMaxChannels> counts{};
  for (int c = 0; c < layer.channels(); ++c) {
    counts[static_cast<std::size_t>(c)] =
        pack_channel(layer.plane(c), background_bits(type, c), masks, s.values);
  }
  const auto used = std::span(counts).first(static_cast<std::size_t>(layer.channels()));
  if (lossy != Lossy::kNone && type.is_evidence()) {
    const std::uint32_t levels = lossy == Lossy::kU8 ? 255 : 65535;
    for (auto& v : s.values) v = quantum(std::bit_cast<float>(v), levels);
    build_masked(used, masks, s.values, lossy == Lossy::kU8 ? 1 : 2, 0, level, s.content, s.candidate);
    keep_smaller(lossy == Lossy::kU8 ? Encoding::kMasked8 : Encoding::kMasked16, s.candidate, best);
    return;
  }
  const int noisy = noisy_planes(s.values);
  build_masked(used, masks, s.values, 4, noisy, level, s.content, s.candidate);
  keep_smaller(Encoding::kMasked32, s.candidate, best);
  if (noisy > 0 && repeats(s.values)) {
    build_masked(used, masks, s.values, 4, 0, level, s.content, s.candidate);
    keep_smaller(Encoding::kMasked32, s.candidate, best);
  }
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
  s.content.resize(masks + n * (static_cast<std::size_t>(width) - raw_planes));
  read_frame(frame, s.content);
  join_planes(Bytes(s.content).subspan(masks), low, n, width, static_cast<int>(raw_planes), s.values);
  if (width < 4) to_masses(width == 1 ? 255.0f : 65535.0f, s.values);
  std::size_t from = 0;
  for (std::size_t c = 0; c < channels; ++c) {
    const Bytes mask = Bytes(s.content).subspan(c * mask_bytes(cells), mask_bytes(cells));
    if (count_bits(mask, cells) != counts[c]) fail_body("a mask does not fit the number of its values");
    const int channel = static_cast<int>(c);
    scatter(mask, std::span(s.values).subspan(from, counts[c]), type.background(channel), out.plane(channel));
    from += counts[c];
  }
}

}  // namespace apgm::format
