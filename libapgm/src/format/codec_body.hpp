#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "apgm/core/error.hpp"
#include "block.hpp"
#include "codec.hpp"
#include "codec_kernels.hpp"

namespace apgm::format {

inline constexpr std::size_t kMaxPalette = 4096;
inline constexpr std::size_t kMaxChannels = 16;

[[noreturn]] void fail_body(const char* what);

template <typename T>
void append_value(std::vector<std::byte>& out, T value) {
  const std::size_t at = out.size();
  out.resize(at + sizeof(T));
  std::memcpy(out.data() + at, &value, sizeof(T));
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
    if (n > rest_.size()) fail_body("a layer body is cut short");
    const Bytes front = rest_.first(n);
    rest_ = rest_.subspan(n);
    return front;
  }
  void expect_end() const {
    if (!rest_.empty()) fail_body("a layer body is longer than its encoding");
  }

 private:
  Bytes rest_;
};

/// Memory that only grows, and is not filled: page faults and zeros cost as much as the work on it.
template <typename T>
class Buffer {
 public:
  /// Room for `n`. What it held before is lost where it grows.
  std::span<T> fit(std::size_t n) {
    if (n > capacity_) {
      memory_.reset();
      capacity_ = 0;
      memory_ = std::make_unique_for_overwrite<T[]>(n);
      capacity_ = n;
    }
    return {memory_.get(), n};
  }

 private:
  std::unique_ptr<T[]> memory_;
  std::size_t capacity_ = 0;
};

/// Scratch of one thread, reused from layer to layer.
struct Scratch {
  Buffer<std::byte> content;  // of a frame, and the planes that are kept raw
  Buffer<std::byte> body;
  Buffer<std::uint32_t> values;
  Buffer<std::uint32_t> tuples;
  Buffer<std::uint16_t> indices;
  Buffer<std::uint16_t> slots;
};
Scratch& scratch();

/// Byte `k` of every value.
template <typename T>
void write_plane(const T* values, std::size_t n, int k, std::byte* out) {
  for (std::size_t i = 0; i < n; ++i) out[i] = static_cast<std::byte>(values[i] >> (8 * k));
}

/// Joins `width` byte planes of `n` values into `values`: the planes from `raw_planes` up lie in `high`, the
/// highest first, the others in `low`.
void join_planes(Bytes high, Bytes low, std::size_t n, int width, int raw_planes, std::uint32_t* values);

/// Makes a body of `head`, a frame of `content`, and `raw`; keeps it if it is smaller than what `best` holds.
void keep_smaller(Encoding encoding, std::span<const std::uint32_t> head, bool with_frame_size, Bytes content,
                  Bytes raw, int level, StoredLayer& best);

// The encodings, each in its own file. The writers keep their result if it is smaller than `best`.
void try_masked(const Layer& layer, const LayerType& type, int level, Lossy lossy, StoredLayer& best);
void decode_masked(Bytes body, int width, const LayerType& type, Layer& out);
void try_palette(const Layer& layer, int level, StoredLayer& best);
void decode_palette(Bytes body, Layer& out);

}  // namespace apgm::format
