#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>

#include "apgm/core/frame.hpp"
#include "apgm/core/layer_type.hpp"

namespace apgm {

/// Cells of one type over one patch (paper, l_t^r): one plane of float32 a channel, each (2^r, 2^r),
/// row-major with cell (a, b) at b * 2^r + a (lower-left first), each plane 64-byte aligned.
///
/// Layers are made to be reused: `reset` keeps the memory when it suffices. Page faults of fresh memory cost
/// more than most arithmetic on it.
class Layer {
 public:
  /// Largest decoded size of a layer: 64 MiB, whatever a file says.
  static constexpr std::size_t kMaxBytes = std::size_t{64} << 20;

  Layer() = default;
  /// All cells without data.
  Layer(const LayerType& type, int step) { reset(type, step); }
  Layer(const Layer& other);
  Layer& operator=(const Layer& other);
  /// A moved-from layer is empty and may be reset.
  Layer(Layer&& other) noexcept { *this = std::move(other); }
  Layer& operator=(Layer&& other) noexcept;

  /// Takes the shape of `type` at `step`, all cells without data.
  /// @throws Error{kLimit} if the step is not in 0..11 or the layer would exceed kMaxBytes
  void reset(const LayerType& type, int step);
  /// Takes a shape only; the cells hold unspecified values.
  void reshape(int channels, int step);

  int step() const { return step_; }
  int channels() const { return channels_; }
  int side() const { return 1 << step_; }
  std::size_t cells() const { return std::size_t{1} << (2 * step_); }
  /// Bytes of the values: channels * cells * 4.
  std::size_t value_bytes() const { return cells() * static_cast<std::size_t>(channels_) * sizeof(float); }
  /// Bytes of memory the layer keeps, whatever its shape is now.
  std::size_t capacity_bytes() const { return capacity_ * sizeof(float); }

  std::span<float> plane(int channel) { return {data_.get() + channel * stride(), cells()}; }
  std::span<const float> plane(int channel) const { return {data_.get() + channel * stride(), cells()}; }
  float& at(int channel, CellIndex c) { return plane(channel)[static_cast<std::size_t>(c.b) * side() + c.a]; }
  float at(int channel, CellIndex c) const {
    return plane(channel)[static_cast<std::size_t>(c.b) * side() + c.a];
  }

  std::int64_t stamp_ns = 0;  ///< time of the newest measurement; 0: not said. Not part of the content
  float error_bound = 0;  ///< stated bound of a lossy encoding the cells went through; 0: none. Not content

 private:
  struct Free {
    void operator()(float* p) const;
  };
  std::size_t stride() const { return (cells() + 15) / 16 * 16; }

  std::unique_ptr<float[], Free> data_;
  std::size_t capacity_ = 0;  // floats
  int channels_ = 0;
  int step_ = 0;
};

/// Same shape and the same bits in every cell. Stamps do not count.
bool same_cells(const Layer& a, const Layer& b);

/// True if no cell of `layer` holds data: every value has the bits of its background.
bool is_vacuous(const Layer& layer, const LayerType& type);

/// Checks and canonicalises: -0 becomes +0, any NaN of a real channel the quiet NaN.
/// @throws Error{kInvalidArgument} if a mass is NaN, negative or above 1, or the masses of a cell sum to more
/// than
///         1 + 1e-6 (with explicit Omega: differ from 1 by more than 1e-6), or a real value is infinite
void canonicalise(Layer& layer, const LayerType& type);

/// True if `canonicalise` would find nothing to change and nothing to refuse.
bool is_canonical(const Layer& layer, const LayerType& type);

}  // namespace apgm
