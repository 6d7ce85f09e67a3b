#include "apgm/fuse/resampled_view.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "apgm/core/error.hpp"
#include "fuse/cells.hpp"
#include "fuse/resample_kernels.hpp"
#include "fuse/resample_native.hpp"

namespace apgm {
namespace {

/// Rows 2b and 2b + 1; those of the pairs that follow stand behind them.
fuse::RowPair row_pair(const Layer& layer, std::size_t b) {
  const auto width = static_cast<std::size_t>(layer.side());
  const float* o = layer.plane(0).data() + 2 * b * width;
  const float* f = layer.plane(1).data() + 2 * b * width;
  return {{o, o + width}, {f, f + width}};
}

}  // namespace

void ResampledView::reset(const Layer& in, const LayerType& type, int step) {
  assert(in.channels() == static_cast<int>(type.channels.size()));
  if (step < 0 || step > kMaxStep) throw Error(ErrorCode::kLimit, "a resolution step lies in 0..11");
  in_ = &in;
  type_ = &type;
  step_ = step;
  begin_.clear();
  std::size_t floats = 0;
  if (step > in.step()) {
    for (int c = 0; c < in.channels(); ++c) begin_.push_back(std::exchange(floats, floats + width(0)));
  } else if (step < in.step() && fuse::merges_by_rows(type.policy)) {
    // Two rows, two channels each, of every level between.
    for (int level = 0; level < in.step() - step; ++level) {
      begin_.push_back(floats);
      if (level > 0) floats += 4 * width(level);
    }
  }
  if (rows_.size() < floats) rows_.resize(floats);
}

void ResampledView::make(RowRange rows, std::span<float* const> planes) {
  assert(rows.begin >= 0 && rows.end <= side());
  if (rows.empty()) return;
  if (step_ > in_->step()) return split(rows, planes);
  if (step_ < in_->step()) return merge(rows, planes);
  const auto first = static_cast<std::size_t>(rows.begin) * width(0);
  const auto count = static_cast<std::size_t>(rows.end - rows.begin) * width(0);
  for (int c = 0; c < channels(); ++c) {
    std::copy_n(in_->plane(c).data() + first, count, planes[static_cast<std::size_t>(c)]);
  }
}

void ResampledView::merge(RowRange rows, std::span<float* const> planes) {
  const auto begin = static_cast<std::size_t>(rows.begin);
  const auto count = static_cast<std::size_t>(rows.end - rows.begin);
  const auto row = static_cast<std::size_t>(side());
  if (fuse::merges_by_rows(type_->policy)) {
    if (in_->step() - step_ == 1) {
      return fuse::merge_rows(type_->policy, row_pair(*in_, begin), planes[0], planes[1], row, count);
    }
    for (std::size_t b = 0; b < count; ++b) {
      merge_row(in_->step() - step_, begin + b, planes[0] + b * row, planes[1] + b * row);
    }
    return;
  }
  const fuse::CoarseCells cells{*in_, step_, begin * row, count * row};
  if (type_->policy == Policy::kEvidence) return fuse::merge_evidence(cells, *type_, planes);
  if (type_->policy == Policy::kMedian) return fuse::merge_median(cells, planes);
  if (type_->policy == Policy::kDempster) return fuse::merge_dempster(cells, planes);
  fuse::merge_pool(cells, *type_, planes);
}

/// Row `b` of the layer `level` >= 2 steps coarser than the input, 2x2 level by level: a row asks for the two
/// below it. What it needs stays in the cache.
void ResampledView::merge_row(int level, std::size_t b, float* o, float* f) {
  const std::size_t n = width(level - 1);
  float* const below_o = scratch(level - 1);
  float* const below_f = below_o + 2 * n;
  if (level == 2) {
    fuse::merge_rows(type_->policy, row_pair(*in_, 2 * b), below_o, below_f, n, 2);
  } else {
    for (std::size_t i = 0; i < 2; ++i) merge_row(level - 1, 2 * b + i, below_o + i * n, below_f + i * n);
  }
  const fuse::RowPair below{{below_o, below_o + n}, {below_f, below_f + n}};
  fuse::merge_rows(type_->policy, below, o, f, width(level), 1);
}

void ResampledView::split(RowRange rows, std::span<float* const> planes) {
  const int levels = step_ - in_->step();
  const auto row = static_cast<std::size_t>(side());
  for (int b = rows.begin; b < rows.end;) {
    const int from = b >> levels;
    const int end = std::min(rows.end, (from + 1) << levels);
    // Row by row, so that the arithmetic of one runs while the stores of the last drain: bands of several
    // rows took up to 1.4 times as long out of cache.
    divide(static_cast<std::size_t>(from));
    for (int c = 0; c < channels(); ++c) {
      float* to = planes[static_cast<std::size_t>(c)] + static_cast<std::size_t>(b - rows.begin) * row;
      fuse::spread_row(scratch(c), levels, to, width(0));
      for (int k = 1; k < end - b; ++k) std::copy_n(to, row, to + static_cast<std::size_t>(k) * row);
    }
    b = end;
  }
}

/// What each part of the cells of row `row` of the input holds, into scratch(channel).
void ResampledView::divide(std::size_t row) {
  const int levels = step_ - in_->step();
  const std::size_t n = width(0);
  const fuse::ConstCells in = fuse::cells_of(*in_, row * n);
  const Policy policy = type_->policy;
  if (policy == Policy::kEvidence) {
    fuse::Cells parts{};
    for (int c = 0; c < channels(); ++c) parts[static_cast<std::size_t>(c)] = scratch(c);
    return fuse::split_evidence(in, *type_, levels, parts, n);
  }
  if (type_->is_occupancy() && policy != Policy::kDempster && policy != Policy::kMean) {
    return fuse::split_cells(policy, levels, in[0], in[1], scratch(0), scratch(1), n);
  }
  const float share = policy == Policy::kSum ? std::ldexp(1.0f, -2 * levels) : 1.0f;
  for (int c = 0; c < channels(); ++c) {
    const float* from = in[static_cast<std::size_t>(c)];
    std::transform(from, from + n, scratch(c), [share](float v) { return v * share; });
  }
}

}  // namespace apgm
