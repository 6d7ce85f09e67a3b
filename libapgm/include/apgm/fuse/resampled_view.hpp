#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "apgm/core/layer.hpp"
#include "apgm/fuse/combine.hpp"

namespace apgm {

/// R(l, r) of the paper as a view: rows of a layer at another step, made when they are asked for and never
/// stored as a whole. resample() is all its rows, so the bits are the same.
///
/// When it is which: making all rows costs what resample() costs. Fusing strips of rows took 1.00 to 1.07 of
/// the time of resampling whole layers into recycled memory first at steps 5 to 8, and 0.97 to 1.05 at step 9
/// (fuse-bench, View; occupancy, merge and split). So LayerFuser makes layers of up to 512 KiB at once and
/// larger ones in strips, which bounds its memory; a caller who reads rows more than once takes resample().
///
/// One thread an object; keeps its scratch memory across reset().
class ResampledView {
 public:
  ResampledView() = default;
  ResampledView(const Layer& in, const LayerType& type, int step) { reset(in, type, step); }

  /// Looks at `in`, which must stay where it is, by the policy of `type`.
  /// @throws Error{kLimit} if `step` is outside 0..11
  void reset(const Layer& in, const LayerType& type, int step);

  int step() const { return step_; }
  int side() const { return 1 << step_; }
  int channels() const { return in_->channels(); }

  /// Makes rows [begin, end) of all channels. A split makes 2^(step - in.step()) rows from one: bands of a
  /// multiple of that, from a multiple of it, make nothing twice.
  /// @param rows    within 0 .. side()
  /// @param planes  for each channel, where row `begin` goes: (end - begin) * side() floats, not in the layer
  /// itself
  void make(RowRange rows, std::span<float* const> planes);

 private:
  void merge_row(int level, std::size_t b, float* o, float* f);
  void merge(RowRange rows, std::span<float* const> planes);
  void split(RowRange rows, std::span<float* const> planes);
  void divide(std::size_t row);
  float* scratch(int level) { return rows_.data() + begin_[static_cast<std::size_t>(level)]; }
  std::size_t width(int level) const { return std::size_t{1} << (in_->step() - level); }

  const Layer* in_ = nullptr;
  const LayerType* type_ = nullptr;
  int step_ = 0;
  std::vector<std::size_t> begin_;  // merge: of the rows of each level; split: of each channel
  std::vector<float> rows_;
};

}  // namespace apgm
