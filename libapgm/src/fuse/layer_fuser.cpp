#include <algorithm>
#include <cassert>

#include "apgm/core/error.hpp"
#include "apgm/fuse/framework.hpp"
#include "apgm/fuse/resampled_view.hpp"
#include "fuse/cells.hpp"
#include "fuse/combine_blocks.hpp"

namespace apgm {
namespace {

/// Bytes of a strip over all inputs that are made. Layers up to this size are made at once: smaller strips
/// took up to 7 % longer at steps 5 to 8, while larger layers would leave the second-level cache.
constexpr std::size_t kStripBytes = std::size_t{512} << 10;

/// An input that is made strip by strip: resampled, discounted, or both.
struct Made {
  ResampledView view;
  std::size_t input = 0;
  int levels = 0;  // of a split
  std::vector<float> strip;
  fuse::Cells cells{};

  void make(const FuseInput& from, RowRange rows, const fuse::Cells& to) {
    view.make(rows, to);
    const auto count =
        static_cast<std::size_t>(rows.end - rows.begin) * static_cast<std::size_t>(view.side());
    fuse::discount_cells(to, *from.type, from.alpha, count);
  }
};

void check(std::span<const FuseInput> inputs) {
  for (const FuseInput& input : inputs) {
    if (!(input.alpha >= 0.0f && input.alpha <= 1.0f)) {
      throw Error(ErrorCode::kInvalidArgument, "a discount factor lies between 0 and 1");
    }
    if (input.type != inputs[0].type && !input.type->same_space(*inputs[0].type)) {
      throw Error(ErrorCode::kIncompatible, "layers of different types cannot be fused: '" +
                                                inputs[0].type->name + "' and '" + input.type->name + "'");
    }
    if (input.layer->channels() != static_cast<int>(input.type->channels.size())) {
      throw Error(ErrorCode::kIncompatible, "layers '" + input.type->name + "' to combine differ in shape");
    }
  }
}

}  // namespace

int fused_step(std::span<const int> steps, std::optional<int> required) {
  assert(!steps.empty());
  const int finest = *std::max_element(steps.begin(), steps.end());
  return required ? std::min(*required, finest) : finest;
}

struct LayerFuser::State {
  std::vector<int> steps;
  std::vector<fuse::ConstCells> cells;  // of each input, where the strip in hand begins
  std::vector<Made> made;
  std::size_t made_count = 0;
  Layer kept;  // an input that is also the output, at another step
  fuse::CombineScratch combine;

  void open(std::span<const FuseInput> inputs, int step, Layer& out);
  int strip_rows(int side, int channels);
  std::uint64_t fuse_strips(std::span<const FuseInput> inputs, Rule rule, Layer& out, float* conflict);
};

/// Shapes `out` and decides which inputs are read where they stand.
void LayerFuser::State::open(std::span<const FuseInput> inputs, int step, Layer& out) {
  const auto is_out = [&](const FuseInput& input) { return input.layer == &out; };
  const bool is_input = std::any_of(inputs.begin(), inputs.end(), is_out);
  const bool replaces = is_input && out.step() != step;
  if (replaces) std::swap(kept, out);
  if (!is_input || replaces) out.reshape(static_cast<int>(inputs[0].type->channels.size()), step);
  cells.assign(inputs.size(), {});
  made_count = 0;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const FuseInput& input = inputs[i];
    const Layer& layer = replaces && is_out(input) ? kept : *input.layer;
    if (layer.step() == step && input.alpha == 1.0f) continue;
    if (made.size() == made_count) made.emplace_back();
    Made& m = made[made_count++];
    m.view.reset(layer, *input.type, step);
    m.input = i;
    m.levels = std::max(0, step - layer.step());
  }
}

/// Makes room for strips. @return their rows, a multiple of the rows that a split makes from one.
int LayerFuser::State::strip_rows(int side, int channels) {
  const auto row = static_cast<std::size_t>(side) * static_cast<std::size_t>(channels) * sizeof(float);
  const int fit = static_cast<int>(kStripBytes / (row * made_count));
  int rows = 1;
  while (2 * rows <= fit && rows < side) rows *= 2;
  for (std::size_t i = 0; i < made_count; ++i) rows = std::max(rows, 1 << made[i].levels);
  const std::size_t plane = static_cast<std::size_t>(rows) * static_cast<std::size_t>(side);
  for (std::size_t i = 0; i < made_count; ++i) {
    Made& m = made[i];
    if (m.strip.size() < plane * static_cast<std::size_t>(channels)) {
      m.strip.resize(plane * static_cast<std::size_t>(channels));
    }
    for (std::size_t c = 0; c < static_cast<std::size_t>(channels); ++c)
      m.cells[c] = m.strip.data() + c * plane;
  }
  return rows;
}

LayerFuser::LayerFuser() : state_(std::make_unique<State>()) {}
LayerFuser::~LayerFuser() = default;
LayerFuser::LayerFuser(LayerFuser&&) noexcept = default;
LayerFuser& LayerFuser::operator=(LayerFuser&&) noexcept = default;

std::uint64_t LayerFuser::State::fuse_strips(std::span<const FuseInput> inputs, Rule rule, Layer& out,
                                             float* conflict) {
  const int side = out.side();
  const int rows = made_count == 0 ? side : strip_rows(side, out.channels());
  const std::size_t count = static_cast<std::size_t>(rows) * static_cast<std::size_t>(side);
  std::uint64_t total = 0;
  for (int b = 0; b < side; b += rows) {
    const std::size_t first = static_cast<std::size_t>(b) * static_cast<std::size_t>(side);
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      if (inputs[i].layer->step() == out.step()) cells[i] = fuse::cells_of(*inputs[i].layer, first);
    }
    for (std::size_t i = 0; i < made_count; ++i) {
      Made& m = made[i];
      m.make(inputs[m.input], {b, b + rows}, m.cells);
      std::copy(m.cells.begin(), m.cells.end(), cells[m.input].begin());
    }
    float* k = conflict == nullptr ? nullptr : conflict + first;
    total += fuse::combine_cells(cells, *inputs[0].type, rule, fuse::cells_of(out, first), count, k, combine);
  }
  return total;
}

CombineReport LayerFuser::fuse(std::span<const FuseInput> inputs, std::optional<int> required, Rule rule,
                               Layer& out, std::vector<float>* conflict) {
  assert(!inputs.empty());
  State& s = *state_;
  check(inputs);
  s.steps.clear();
  std::int64_t stamp_ns = inputs[0].layer->stamp_ns;
  for (const FuseInput& input : inputs) {
    s.steps.push_back(input.layer->step());
    stamp_ns = std::max(stamp_ns, input.layer->stamp_ns);
  }
  const int step = fused_step(s.steps, required);
  if (step < 0) throw Error(ErrorCode::kLimit, "a resolution step lies in 0..11");
  const bool keeps_bound = inputs.size() == 1 && inputs[0].layer->step() == step;
  const float error_bound = keeps_bound ? inputs[0].layer->error_bound : 0.0f;
  const bool stays = keeps_bound && inputs[0].layer == &out;

  s.open(inputs, step, out);
  if (conflict != nullptr) conflict->resize(out.cells());
  float* k = conflict == nullptr ? nullptr : conflict->data();
  CombineReport report;
  if (inputs.size() == 1 && s.made_count == 1) {
    if (stays) {
      fuse::discount_cells(fuse::cells_of(out), *inputs[0].type, inputs[0].alpha, out.cells());
    } else {
      s.made[0].make(inputs[0], {0, out.side()}, fuse::cells_of(out));
    }
    if (k != nullptr) std::fill_n(k, out.cells(), 0.0f);
  } else {
    report.total_conflicts = s.fuse_strips(inputs, rule, out, k);
  }
  out.stamp_ns = stamp_ns;
  out.error_bound = error_bound;
  return report;
}

}  // namespace apgm
