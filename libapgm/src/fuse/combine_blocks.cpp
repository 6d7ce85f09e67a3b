#include "fuse/combine_blocks.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <vector>

#include "fuse/combine_kernels.hpp"

namespace apgm::fuse {
namespace {

/// Combines block by block; one object a call of combine().
class Blocks {
 public:
  Blocks(std::span<const ConstCells> inputs, const LayerType& type, Rule rule, const Cells& out,
         std::size_t cells, float* conflict, CombineScratch& scratch)
      : inputs_(inputs),
        type_(type),
        rule_(rule),
        out_(out),
        cells_(cells),
        conflict_(conflict),
        channels_(type.channels.size()),
        hypotheses_(type.hypotheses.size()),
        width_(type.is_evidence() ? hypotheses_ + 1 : channels_),
        rows_(scratch.rows),
        holds_(scratch.holds) {
    rows_.resize(inputs.size() * width_ * kBlock);
    holds_.resize(inputs.size() * kBlock);
  }

  std::uint64_t run() {
    std::uint64_t total = 0;
    for (std::size_t begin = 0; begin < cells_; begin += kBlock) {
      const std::size_t count = std::min(kBlock, cells_ - begin);
      read(begin, count);
      // Also for kMax, where it breaks ties. kLast is the one rule that must see the given order.
      if (rule_ != Rule::kLast) fuse::sort_inputs(rows_.data(), inputs_.size(), width_);
      find_data();
      k_.fill(0.0f);
      if (conflict_ != nullptr && type_.is_evidence() && !is_conjunctive()) measure_conflict();
      total += combine_block(count);
      write(begin, count);
    }
    return total;
  }

 private:
  float* input(std::size_t i) { return rows_.data() + i * width_ * kBlock; }
  std::int32_t* holds(std::size_t i) { return holds_.data() + i * kBlock; }

  void read(std::size_t begin, std::size_t count) {
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      for (std::size_t c = 0; c < width_; ++c) {
        float* row = input(i) + c * kBlock;
        if (c < channels_) {
          std::copy_n(inputs_[i][c] + begin, count, row);
          std::fill(row + count, row + kBlock, type_.background(static_cast<int>(c)));
        } else {
          fuse::omit_masses(input(i), hypotheses_, row);
        }
      }
    }
  }

  void find_data() {
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      if (type_.is_evidence()) {
        fuse::holds_belief(input(i), hypotheses_, holds(i));
        continue;
      }
      std::fill_n(holds(i), kBlock, 0);
      for (std::size_t c = 0; c < channels_; ++c) {
        const auto background = std::bit_cast<std::uint32_t>(type_.background(static_cast<int>(c)));
        const float* row = input(i) + c * kBlock;
        for (std::size_t x = 0; x < kBlock; ++x) {
          holds(i)[x] |= std::bit_cast<std::uint32_t>(row[x]) != background;
        }
      }
    }
  }

  std::uint64_t combine_block(std::size_t count) {
    switch (rule_) {
      case Rule::kDempster:
      case Rule::kYager:
        return combine_belief(count);
      case Rule::kMean:
        combine_mean();
        break;
      case Rule::kMax:
        combine_max();
        break;
      case Rule::kLast:
        for (std::size_t i = 1; i < inputs_.size(); ++i) take_where(i, holds(i));
        break;
    }
    return 0;
  }

  std::uint64_t combine_belief(std::size_t count) {
    std::array<std::int32_t, kBlock> held;
    std::copy_n(holds(0), kBlock, held.begin());
    const bool normalise = rule_ == Rule::kDempster;
    for (std::size_t i = 1; i < inputs_.size(); ++i) {
      fuse::fold(input(0), input(i), hypotheses_, normalise, held.data(), holds(i),
                 conflict_ != nullptr ? k_.data() : nullptr);
    }
    fuse::bound_masses(input(0), hypotheses_, held.data());
    if (!normalise) {
      give_rest_to_omega(held);
      return 0;
    }
    return clear_dead(held, count);
  }

  /// Yager: what the masses leave is m(Omega), the conflict with it.
  void give_rest_to_omega(const std::array<std::int32_t, kBlock>& held) {
    std::array<float, kBlock> rest;
    fuse::omit_masses(input(0), hypotheses_, rest.data());
    float* omega = input(0) + hypotheses_ * kBlock;
    for (std::size_t x = 0; x < kBlock; ++x) omega[x] = held[x] > 1 ? rest[x] : omega[x];
  }

  /// Cells of total conflict hold nothing but zeros after the folds: they become vacuous.
  std::uint64_t clear_dead(const std::array<std::int32_t, kBlock>& held, std::size_t count) {
    std::uint64_t dead = 0;
    for (std::size_t x = 0; x < count; ++x) {
      float sum = 0;
      for (std::size_t c = 0; c <= hypotheses_; ++c) sum += input(0)[c * kBlock + x];
      if (held[x] < 2 || sum != 0.0f) continue;
      input(0)[hypotheses_ * kBlock + x] = 1.0f;
      ++dead;
    }
    return dead;
  }

  /// In each channel the mean over the inputs that hold data in the cell and a number in the channel; one
  /// such input keeps its bits. Sums are made in double, in the sorted order.
  void combine_mean() {
    std::array<float, kBlock> before{};
    for (std::size_t c = 0; c < width_; ++c) {
      std::array<double, kBlock> sum{};
      std::array<std::int32_t, kBlock> number{};
      for (std::size_t i = 0; i < inputs_.size(); ++i) {
        const float* row = input(i) + c * kBlock;
        for (std::size_t x = 0; x < kBlock; ++x) {
          const bool counts = (holds(i)[x] != 0) & (row[x] == row[x]);
          sum[x] += counts ? static_cast<double>(row[x]) : 0.0;
          number[x] += counts;
        }
      }
      const float none = c < channels_ ? type_.background(static_cast<int>(c)) : 1.0f;
      for (std::size_t x = 0; x < kBlock; ++x) {
        float m = number[x] > 0 ? static_cast<float>(sum[x] / number[x]) : none;
        if (number[x] > 1 && c + 1 == hypotheses_) m = std::min(m, std::max(0.0f, 1.0f - before[x]));
        input(0)[c * kBlock + x] = m;
        before[x] += m;
      }
    }
  }

  /// Occupancy: greatest m(O), then greatest m(F). Other frames: least m(Omega), then the greatest tuple.
  void combine_max() {
    if (!type_.is_evidence()) return combine_max_real();
    const bool by_occupied = type_.is_occupancy();
    const std::size_t row = by_occupied ? 0 : hypotheses_ * kBlock;
    std::array<std::int32_t, kBlock> takes;
    for (std::size_t i = 1; i < inputs_.size(); ++i) {
      for (std::size_t x = 0; x < kBlock; ++x) {
        const float best = input(0)[row + x], other = input(i)[row + x];
        takes[x] = by_occupied ? other >= best : other <= best;
      }
      take_where(i, takes.data());
    }
  }

  /// Each channel the greatest number that an input with data has in it.
  void combine_max_real() {
    for (std::size_t i = 1; i < inputs_.size(); ++i) {
      for (std::size_t x = 0; x < width_ * kBlock; ++x) {
        const float best = input(0)[x], other = input(i)[x];
        const bool keeps = holds(0)[x % kBlock] != 0 && (best >= other || other != other);
        input(0)[x] = holds(i)[x % kBlock] == 0 || keeps ? best : other;
      }
      for (std::size_t x = 0; x < kBlock; ++x) holds(0)[x] |= holds(i)[x];
    }
  }

  void take_where(std::size_t i, const std::int32_t* takes) {
    for (std::size_t c = 0; c < width_; ++c) {
      float* best = input(0) + c * kBlock;
      const float* other = input(i) + c * kBlock;
      for (std::size_t x = 0; x < kBlock; ++x) best[x] = takes[x] != 0 ? other[x] : best[x];
    }
  }

  /// K of the inputs under a rule that does not come by it: what Dempster's rule would meet.
  void measure_conflict() {
    std::vector<float> rows = rows_;
    fuse::sort_inputs(rows.data(), inputs_.size(), width_);
    std::array<std::int32_t, kBlock> held, in;
    fuse::holds_belief(rows.data(), hypotheses_, held.data());
    for (std::size_t i = 1; i < inputs_.size(); ++i) {
      const float* row = rows.data() + i * width_ * kBlock;
      fuse::holds_belief(row, hypotheses_, in.data());
      fuse::fold(rows.data(), row, hypotheses_, true, held.data(), in.data(), k_.data());
    }
  }

  bool is_conjunctive() const { return rule_ == Rule::kDempster || rule_ == Rule::kYager; }

  void write(std::size_t begin, std::size_t count) {
    for (std::size_t c = 0; c < channels_; ++c) {
      std::copy_n(input(0) + c * kBlock, count, out_[c] + begin);
    }
    if (conflict_ != nullptr) std::copy_n(k_.data(), count, conflict_ + begin);
  }

  std::span<const ConstCells> inputs_;
  const LayerType& type_;
  Rule rule_;
  const Cells& out_;
  std::size_t cells_;
  float* conflict_;
  std::size_t channels_;
  std::size_t hypotheses_;
  std::size_t width_;
  std::vector<float>& rows_;
  std::vector<std::int32_t>& holds_;
  std::array<float, kBlock> k_;
};

}  // namespace

std::uint64_t combine_blocks(std::span<const ConstCells> inputs, const LayerType& type, Rule rule,
                             const Cells& out, std::size_t cells, float* conflict, CombineScratch& scratch) {
  return Blocks(inputs, type, rule, out, cells, conflict, scratch).run();
}

std::uint64_t combine_cells(std::span<const ConstCells> inputs, const LayerType& type, Rule rule,
                            const Cells& out, std::size_t cells, float* conflict, CombineScratch& scratch) {
  if (!type.is_evidence() && (rule == Rule::kDempster || rule == Rule::kYager)) rule = Rule::kMean;
  if (inputs.size() == 1) {
    for (std::size_t c = 0; c < type.channels.size() && inputs[0][c] != out[c]; ++c) {
      std::copy_n(inputs[0][c], cells, out[c]);
    }
    if (conflict != nullptr) std::fill_n(conflict, cells, 0.0f);
    return 0;
  }
  if (inputs.size() == 2 && type.is_occupancy() && rule == Rule::kDempster) {
    const OccupancyPlanes a{inputs[0][0], inputs[0][1]}, b{inputs[1][0], inputs[1][1]};
    const OccupancyOut z{out[0], out[1]};
    return conflict == nullptr ? dempster_two(a, b, z, cells) : dempster_two(a, b, z, conflict, cells);
  }
  return combine_blocks(inputs, type, rule, out, cells, conflict, scratch);
}

void discount_cells(const Cells& cells, const LayerType& type, float alpha, std::size_t count) {
  if (!type.is_evidence() || alpha == 1.0f) return;
  const std::size_t masses = type.hypotheses.size();
  for (std::size_t c = 0; c < masses; ++c) fuse::discount_masses(cells[c], alpha, count);
  if (type.stores_omega()) fuse::discount_omega(cells[masses], alpha, count);
}

}  // namespace apgm::fuse
