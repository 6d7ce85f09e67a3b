#include "codec.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <memory>
#include <numeric>
#include <optional>
#include <vector>

#include <zstd.h>

#include "apgm/core/error.hpp"
#include "content_id.hpp"

namespace apgm::format {
namespace {

constexpr std::size_t kMaxPalette = 4096;
constexpr std::size_t kMaxChannels = 16;

[[noreturn]] void fail(const char* what) { throw Error(ErrorCode::kDamaged, what); }

// --- small readers and writers of bodies
// -------------------------------------------------------------------------

template <typename T>
void append_value(std::vector<std::byte>& out, T value) {
  const Bytes bytes = bytes_of(value);
  out.insert(out.end(), bytes.begin(), bytes.end());
}

/// Takes values off the front of a body; running out is damage.
class BodyReader {
 public:
  explicit BodyReader(Bytes body) : rest_(body) {}
  template <typename T>
  T take() {
    return read_as<T>(take_bytes(sizeof(T)));
  }
  Bytes take_bytes(std::size_t n) {
    if (n > rest_.size()) fail("a layer body is cut short");
    const Bytes front = rest_.first(n);
    rest_ = rest_.subspan(n);
    return front;
  }
  void expect_end() const {
    if (!rest_.empty()) fail("a layer body is longer than its encoding");
  }

 private:
  Bytes rest_;
};

std::size_t mask_bytes(std::size_t cells) { return (cells + 7) / 8; }

std::uint32_t background_bits(const LayerType& type, int channel) {
  return std::bit_cast<std::uint32_t>(type.background(channel));
}

/// Scratch of one thread, reused from layer to layer.
struct Scratch {
  std::vector<std::byte> content;
  std::vector<std::byte> candidate;
  std::vector<std::uint32_t> values;
  std::vector<std::uint32_t> tuples;
  std::vector<std::uint16_t> indices;
  std::vector<std::uint16_t> slots;
};
Scratch& scratch() {
  thread_local Scratch s;
  return s;
}

// --- byte planes
// -------------------------------------------------------------------------------------------------

/// Byte `k` of every value.
template <typename T>
void write_plane(const T* values, std::size_t n, int k, std::byte* out) {
  for (std::size_t i = 0; i < n; ++i) out[i] = static_cast<std::byte>(values[i] >> (8 * k));
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

// --- masked
// ------------------------------------------------------------------------------------------------------

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

void keep_smaller(Encoding encoding, std::vector<std::byte>& candidate, StoredLayer& best) {
  if (!best.bytes.empty() && best.bytes.size() <= candidate.size()) return;
  best.encoding = static_cast<std::uint8_t>(encoding);
  best.bytes.swap(candidate);
}

std::uint32_t quantum(float value, std::uint32_t levels) {
  return static_cast<std::uint32_t>(std::lrint(static_cast<double>(value) * levels));
}

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

template <typename T>
void join_planes(Bytes high, Bytes low, std::size_t n, int raw_planes, std::vector<std::uint32_t>& values) {
  constexpr int kWidth = sizeof(T);
  values.assign(n, 0);
  const auto plane = [&](int k) {
    return k >= raw_planes ? high.subspan(static_cast<std::size_t>(kWidth - 1 - k) * n, n)
                           : low.subspan(static_cast<std::size_t>(raw_planes - 1 - k) * n, n);
  };
  if constexpr (kWidth == 4) {
    const std::byte *p3 = plane(3).data(), *p2 = plane(2).data(), *p1 = plane(1).data(),
                    *p0 = plane(0).data();
    for (std::size_t i = 0; i < n; ++i) {
      values[i] = static_cast<std::uint32_t>(p3[i]) << 24 | static_cast<std::uint32_t>(p2[i]) << 16 |
                  static_cast<std::uint32_t>(p1[i]) << 8 | static_cast<std::uint32_t>(p0[i]);
    }
  } else {
    constexpr float kLevels = static_cast<float>((1u << (8 * kWidth)) - 1);
    for (std::size_t i = 0; i < n; ++i) {
      std::uint32_t q = 0;
      for (int k = kWidth - 1; k >= 0; --k) q = q << 8 | static_cast<std::uint32_t>(plane(k)[i]);
      values[i] = std::bit_cast<std::uint32_t>(static_cast<float>(q) / kLevels);
    }
  }
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
    fail("a mask has bits beyond its cells");
  return count;
}

template <typename T>
void decode_masked(Bytes body, const LayerType& type, Layer& out) {
  constexpr int kWidth = sizeof(T);
  BodyReader reader(body);
  const auto channels = static_cast<std::size_t>(out.channels());
  const std::size_t cells = out.cells();
  std::array<std::uint32_t, kMaxChannels> counts{};
  std::size_t n = 0;
  for (std::size_t c = 0; c < channels; ++c) {
    counts[c] = reader.take<std::uint32_t>();
    if (counts[c] > cells) fail("a layer holds more values than cells");
    n += counts[c];
  }
  const auto raw_planes = reader.take<std::uint32_t>();
  if (raw_planes > (kWidth == 4 ? 2 : 0)) fail("a layer keeps more raw planes than its encoding allows");
  const Bytes frame = reader.take_bytes(reader.take<std::uint32_t>());
  const Bytes low = reader.take_bytes(n * raw_planes);
  reader.expect_end();
  Scratch& s = scratch();
  const std::size_t masks = channels * mask_bytes(cells);
  s.content.resize(masks + n * (kWidth - raw_planes));
  read_frame(frame, s.content);
  join_planes<T>(Bytes(s.content).subspan(masks), low, n, static_cast<int>(raw_planes), s.values);
  std::size_t from = 0;
  for (std::size_t c = 0; c < channels; ++c) {
    const Bytes mask = Bytes(s.content).subspan(c * mask_bytes(cells), mask_bytes(cells));
    if (count_bits(mask, cells) != counts[c]) fail("a mask does not fit the number of its values");
    const int channel = static_cast<int>(c);
    scatter(mask, std::span(s.values).subspan(from, counts[c]), type.background(channel), out.plane(channel));
    from += counts[c];
  }
}

// --- palette
// -----------------------------------------------------------------------------------------------------

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
      s.tuples.insert(s.tuples.end(), tuple.begin(), tuple.begin() + static_cast<std::ptrdiff_t>(channels));
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
    sorted.insert(sorted.end(), t.begin(), t.end());
  }
  s.tuples.swap(sorted);
  for (auto& i : s.indices) i = rank[i];
}

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
  if (n < 1 || n > kMaxPalette) fail("a palette holds no tuple or more than 4096");
  const std::size_t values = n * channels;
  const std::size_t index_bytes = n > 256 ? 2 : 1;
  Scratch& s = scratch();
  s.content.resize(values * 4 + cells * index_bytes);
  read_frame(body.subspan(sizeof(std::uint32_t)), s.content);
  join_planes<std::uint32_t>(Bytes(s.content).first(values * 4), {}, values, 0, s.tuples);
  const std::byte* high = s.content.data() + values * 4;
  const std::byte* low = high + (index_bytes - 1) * cells;
  s.indices.resize(cells);
  std::uint16_t largest = 0;
  for (std::size_t i = 0; i < cells; ++i) {
    const unsigned hi = index_bytes == 2 ? static_cast<unsigned>(high[i]) << 8 : 0u;
    s.indices[i] = static_cast<std::uint16_t>(hi | static_cast<unsigned>(low[i]));
    largest = std::max(largest, s.indices[i]);
  }
  if (largest >= n) fail("a palette index is out of range");
  for (std::size_t c = 0; c < channels; ++c) {
    float* plane = out.plane(static_cast<int>(c)).data();
    for (std::size_t i = 0; i < cells; ++i)
      plane[i] = std::bit_cast<float>(s.tuples[s.indices[i] * channels + c]);
  }
}

// --- constant
// ----------------------------------------------------------------------------------------------------

bool is_constant(const Layer& layer) {
  for (int c = 0; c < layer.channels(); ++c) {
    const auto plane = layer.plane(c);
    const auto first = std::bit_cast<std::uint32_t>(plane[0]);
    for (std::size_t i = 0; i < plane.size(); i += 256) {
      std::uint32_t differs = 0;
      const std::size_t end = std::min(plane.size(), i + 256);
      for (std::size_t k = i; k < end; ++k) differs |= std::bit_cast<std::uint32_t>(plane[k]) ^ first;
      if (differs != 0) return false;
    }
  }
  return true;
}

void decode_constant(Bytes body, Layer& out) {
  BodyReader reader(body);
  for (int c = 0; c < out.channels(); ++c) std::ranges::fill(out.plane(c), reader.take<float>());
  reader.expect_end();
}

/// Whole numbers of 1/levels that sum to `levels`: floors, then one more for the largest remainders.
void largest_remainders(std::span<const double> masses, std::uint32_t levels, std::span<std::uint32_t> out) {
  std::array<double, kMaxChannels + 1> rest{};
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i < masses.size(); ++i) {
    const double exact = masses[i] * levels;
    out[i] = static_cast<std::uint32_t>(exact);
    rest[i] = exact - out[i];
    sum += out[i];
  }
  while (sum < levels) {
    const auto i = std::max_element(rest.begin(), rest.begin() + static_cast<std::ptrdiff_t>(masses.size())) -
                   rest.begin();
    ++out[static_cast<std::size_t>(i)];
    rest[static_cast<std::size_t>(i)] = -1;
    ++sum;
  }
  while (sum > levels) {  // masses that sum to slightly more than 1
    --*std::max_element(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(masses.size()));
    --sum;
  }
}

}  // namespace

std::size_t append_frame(std::vector<std::byte>& out, Bytes content, int level) {
  thread_local const std::unique_ptr<ZSTD_CCtx, decltype(&ZSTD_freeCCtx)> context(ZSTD_createCCtx(),
                                                                                  &ZSTD_freeCCtx);
  if (context == nullptr) throw std::bad_alloc();
  const std::size_t start = out.size();
  out.resize(start + ZSTD_compressBound(content.size()));
  const std::size_t n = ZSTD_compressCCtx(context.get(), out.data() + start, out.size() - start,
                                          content.data(), content.size(), level);
  if (ZSTD_isError(n)) throw Error(ErrorCode::kLimit, std::string("zstd: ") + ZSTD_getErrorName(n));
  out.resize(start + n);
  return n;
}

void read_frame(Bytes frame, std::span<std::byte> out) {
  thread_local const std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> context(ZSTD_createDCtx(),
                                                                                  &ZSTD_freeDCtx);
  if (context == nullptr) throw std::bad_alloc();
  // zstd itself accepts several frames in a row and skips frames of application data: neither belongs here.
  if (frame.size() < 4 || read_as<std::uint32_t>(frame) != ZSTD_MAGICNUMBER)
    fail("a layer does not hold a zstd frame");
  if (ZSTD_getFrameContentSize(frame.data(), frame.size()) != out.size()) {
    fail("a zstd frame does not hold the size that follows from type, encoding and step");
  }
  const std::size_t frame_bytes = ZSTD_findFrameCompressedSize(frame.data(), frame.size());
  if (ZSTD_isError(frame_bytes) || frame_bytes != frame.size()) fail("a zstd frame does not fill its place");
  const std::size_t n =
      ZSTD_decompressDCtx(context.get(), out.data(), out.size(), frame.data(), frame.size());
  if (ZSTD_isError(n) || n != out.size()) fail("a zstd frame cannot be decoded");
}

float error_bound(Lossy lossy) {
  switch (lossy) {
    case Lossy::kNone:
      return 0;
    case Lossy::kU16:
      return 1.0f / 65535.0f;
    case Lossy::kU8:
      return 1.0f / 255.0f;
  }
  return 0;
}

void quantise(Layer& layer, const LayerType& type, Lossy lossy) {
  if (lossy == Lossy::kNone || !type.is_evidence()) return;
  const std::uint32_t levels = lossy == Lossy::kU8 ? 255 : 65535;
  const auto channels = static_cast<std::size_t>(layer.channels());
  const std::size_t parts = type.stores_omega() ? channels : channels + 1;
  std::array<double, kMaxChannels + 1> masses{};
  std::array<std::uint32_t, kMaxChannels + 1> whole{};
  for (std::size_t i = 0; i < layer.cells(); ++i) {
    double omega = 1;
    for (std::size_t c = 0; c < channels; ++c) {
      masses[c] = static_cast<double>(layer.plane(static_cast<int>(c))[i]);
      omega -= masses[c];
    }
    if (parts > channels) masses[channels] = std::max(0.0, omega);
    largest_remainders(std::span(masses).first(parts), levels, whole);
    for (std::size_t c = 0; c < channels; ++c) {
      layer.plane(static_cast<int>(c))[i] = static_cast<float>(whole[c]) / static_cast<float>(levels);
    }
  }
}

void encode(const Layer& layer, const LayerType& type, int level, Lossy lossy, StoredLayer& out) {
  out.bytes.clear();
  out.step = static_cast<std::uint8_t>(layer.step());
  out.content_hash = content_hash(layer);
  out.error_bound = type.is_evidence() ? error_bound(lossy) : 0.0f;
  if (is_constant(layer)) {
    out.encoding = static_cast<std::uint8_t>(Encoding::kConstant);
    for (int c = 0; c < layer.channels(); ++c) append_value(out.bytes, layer.plane(c)[0]);
    return;
  }
  try_palette(layer, level, out);
  try_masked(layer, type, level, lossy, out);
}

void decode(Encoding encoding, int step, Bytes body, const LayerType& type, Layer& out) {
  out.reshape(static_cast<int>(type.channels.size()), step);
  switch (encoding) {
    case Encoding::kConstant:
      decode_constant(body, out);
      break;
    case Encoding::kMasked32:
      decode_masked<std::uint32_t>(body, type, out);
      break;
    case Encoding::kPalette:
      decode_palette(body, out);
      break;
    case Encoding::kMasked16:
      decode_masked<std::uint16_t>(body, type, out);
      break;
    case Encoding::kMasked8:
      decode_masked<std::uint8_t>(body, type, out);
      break;
    default:
      fail("a layer has an unknown encoding");
  }
  if (!is_canonical(out, type)) fail("a layer holds masses out of range");
}

}  // namespace apgm::format
