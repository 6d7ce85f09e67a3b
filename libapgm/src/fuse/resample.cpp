#include "apgm/fuse/resample.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <vector>

#include "apgm/core/error.hpp"
#include "fuse/resample_kernels.hpp"
#include "fuse/resample_native.hpp"

namespace apgm {
namespace {

/// Merges level by level, 2x2 each, without storing a level: a row asks for the two below it. What it needs
/// stays in the cache.
class RowMerger {
 public:
  RowMerger(const Layer& in, Policy policy) : in_(in), policy_(policy) {
    std::size_t floats = 0;
    for (int level = 1; level <= in.step(); ++level) {
      begin_.push_back(floats);
      floats += 4 * width(level);
    }
    rows_.resize(floats);
  }

  /// Row `b` of the layer `level` steps coarser than the input.
  void merge(int level, std::size_t b, float* o, float* f) {
    fuse::RowPair pair;
    for (std::size_t i = 0; i < 2; ++i) {
      if (level == 1) {
        pair.o[i] = in_.plane(0).data() + (2 * b + i) * width(0);
        pair.f[i] = in_.plane(1).data() + (2 * b + i) * width(0);
        continue;
      }
      float* row = rows_.data() + begin_[static_cast<std::size_t>(level) - 2] + i * 2 * width(level - 1);
      merge(level - 1, 2 * b + i, row, row + width(level - 1));
      pair.o[i] = row;
      pair.f[i] = row + width(level - 1);
    }
    fuse::merge_rows(policy_, pair, o, f, width(level));
  }

 private:
  std::size_t width(int level) const { return std::size_t{1} << (in_.step() - level); }

  const Layer& in_;
  Policy policy_;
  std::vector<std::size_t> begin_;  // of the rows of level 1, 2, ... in rows_
  std::vector<float> rows_;
};

void merge(const Layer& in, const LayerType& type, Layer& out) {
  if (fuse::merges_by_rows(type.policy)) {
    RowMerger merger(in, type.policy);
    const auto side = static_cast<std::size_t>(out.side());
    for (std::size_t b = 0; b < side; ++b) {
      merger.merge(in.step() - out.step(), b, out.plane(0).data() + b * side, out.plane(1).data() + b * side);
    }
  } else if (type.policy == Policy::kEvidence) {
    fuse::merge_evidence(in, type, out);
  } else if (type.policy == Policy::kMedian) {
    fuse::merge_median(in, out);
  } else if (type.policy == Policy::kDempster) {
    fuse::merge_dempster(in, out);
  } else {
    fuse::merge_pool(in, type, out);
  }
}

/// What each part of a cell holds, for all cells of `in`.
void divide(const Layer& in, const LayerType& type, int levels, Layer& parts) {
  parts = in;
  if (type.policy == Policy::kEvidence) {
    fuse::split_evidence(in, type, levels, parts);
  } else if (type.policy == Policy::kSum) {
    const float share = std::ldexp(1.0f, -2 * levels);
    for (int c = 0; c < in.channels(); ++c) {
      for (float& v : parts.plane(c)) v *= share;
    }
  } else if (type.is_occupancy() && type.policy != Policy::kDempster && type.policy != Policy::kMean) {
    fuse::split_cells(type.policy, levels, in.plane(0).data(), in.plane(1).data(), parts.plane(0).data(),
                      parts.plane(1).data(), in.cells());
  }
}

void split(const Layer& in, const LayerType& type, Layer& out) {
  const int levels = out.step() - in.step();
  const std::size_t copies = std::size_t{1} << levels;
  const auto side = static_cast<std::size_t>(out.side());
  Layer parts;
  divide(in, type, levels, parts);
  for (int c = 0; c < in.channels(); ++c) {
    const float* from = parts.plane(c).data();
    for (std::size_t row = 0; row < side; row += copies) {
      float* to = out.plane(c).data() + row * side;
      for (std::size_t a = 0; a < side / copies; ++a) std::fill_n(to + a * copies, copies, *from++);
      for (std::size_t k = 1; k < copies; ++k) std::copy_n(to, side, to + k * side);
    }
  }
}

}  // namespace

void resample(const Layer& in, const LayerType& type, int step, Layer& out) {
  assert(&in != &out);
  assert(in.channels() == static_cast<int>(type.channels.size()));
  if (step < 0 || step > kMaxStep) throw Error(ErrorCode::kLimit, "a resolution step lies in 0..11");
  if (step == in.step()) {
    out = in;
    return;
  }
  out.reshape(in.channels(), step);
  out.stamp_ns = in.stamp_ns;
  if (step < in.step()) {
    merge(in, type, out);
  } else {
    split(in, type, out);
  }
}

}  // namespace apgm
