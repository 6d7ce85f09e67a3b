#include "apgm/fuse/combine.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <vector>

#include "apgm/core/error.hpp"
#include "fuse/combine_blocks.hpp"

namespace apgm {
namespace {

constexpr std::array<std::string_view, 5> kRuleNames{"dempster", "yager", "mean", "max", "last"};

void check_shapes(std::span<const Layer* const> inputs, const LayerType& type) {
  assert(!inputs.empty());
  for (const Layer* layer : inputs) {
    if (layer->step() != inputs[0]->step() || layer->channels() != static_cast<int>(type.channels.size())) {
      throw Error(ErrorCode::kIncompatible, "layers '" + type.name + "' to combine differ in shape");
    }
  }
}

std::int64_t newest(std::span<const Layer* const> inputs) {
  std::int64_t stamp_ns = inputs[0]->stamp_ns;
  for (const Layer* layer : inputs) stamp_ns = std::max(stamp_ns, layer->stamp_ns);
  return stamp_ns;
}

/// Combines `cells` cells from `first` on; all layers have one shape.
CombineReport combine_part(std::span<const Layer* const> inputs, const LayerType& type, Rule rule, Layer& out,
                           std::size_t first, std::size_t cells, float* conflict) {
  std::array<fuse::ConstCells, 8> few;
  std::vector<fuse::ConstCells> many(inputs.size() > few.size() ? inputs.size() : 0);
  const std::span<fuse::ConstCells> from =
      many.empty() ? std::span(few).first(inputs.size()) : std::span(many);
  for (std::size_t i = 0; i < inputs.size(); ++i) from[i] = fuse::cells_of(*inputs[i], first);
  fuse::CombineScratch scratch;
  return {fuse::combine_cells(from, type, rule, fuse::cells_of(out, first), cells, conflict, scratch)};
}

}  // namespace

std::string_view to_string(Rule rule) { return kRuleNames.at(static_cast<std::size_t>(rule)); }

std::optional<Rule> rule_from(std::string_view name) {
  const auto it = std::find(kRuleNames.begin(), kRuleNames.end(), name);
  if (it == kRuleNames.end()) return {};
  return static_cast<Rule>(it - kRuleNames.begin());
}

CombineReport combine(std::span<const Layer* const> inputs, const LayerType& type, Rule rule, Layer& out,
                      float* conflict) {
  check_shapes(inputs, type);
  const std::int64_t stamp_ns = newest(inputs);
  const Layer& first = *inputs[0];
  const float error_bound = inputs.size() == 1 ? first.error_bound : 0.0f;
  // Takes the shape only where `out` is no input: an input has it.
  if (std::find(inputs.begin(), inputs.end(), &out) == inputs.end())
    out.reshape(first.channels(), first.step());
  const CombineReport report = combine_part(inputs, type, rule, out, 0, first.cells(), conflict);
  out.stamp_ns = stamp_ns;
  out.error_bound = error_bound;
  return report;
}

CombineReport combine_rows(std::span<const Layer* const> inputs, const LayerType& type, Rule rule, Layer& out,
                           RowRange rows) {
  check_shapes(inputs, type);
  if (out.step() != inputs[0]->step() || out.channels() != inputs[0]->channels()) {
    throw Error(ErrorCode::kIncompatible, "the layer '" + type.name + "' to combine into has another shape");
  }
  if (rows.empty()) return {};
  if (rows.begin < 0 || rows.end > out.side()) {
    throw Error(ErrorCode::kInvalidArgument, "the rows to combine leave the layer");
  }
  const auto side = static_cast<std::size_t>(out.side());
  const CombineReport report =
      combine_part(inputs, type, rule, out, static_cast<std::size_t>(rows.begin) * side,
                   static_cast<std::size_t>(rows.end - rows.begin) * side, nullptr);
  out.stamp_ns = std::max(out.stamp_ns, newest(inputs));
  if (inputs.size() == 1) out.error_bound = std::max(out.error_bound, inputs[0]->error_bound);
  return report;
}

void discount(Layer& layer, const LayerType& type, float alpha) {
  if (!(alpha >= 0.0f && alpha <= 1.0f)) {
    throw Error(ErrorCode::kInvalidArgument, "a discount factor lies between 0 and 1");
  }
  fuse::discount_cells(fuse::cells_of(layer), type, alpha, layer.cells());
}

}  // namespace apgm
