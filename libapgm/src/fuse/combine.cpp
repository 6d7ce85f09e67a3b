#include "apgm/fuse/combine.hpp"

#include <algorithm>
#include <array>
#include <cassert>

#include "apgm/core/error.hpp"
#include "fuse/combine_blocks.hpp"
#include "fuse/combine_kernels.hpp"

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

std::uint64_t combine_two(const Layer& a, const Layer& b, Layer& out, float* conflict) {
  const fuse::OccupancyPlanes x{a.plane(0).data(), a.plane(1).data()};
  const fuse::OccupancyPlanes y{b.plane(0).data(), b.plane(1).data()};
  const fuse::OccupancyOut z{out.plane(0).data(), out.plane(1).data()};
  if (conflict == nullptr) return fuse::dempster_two(x, y, z, a.cells());
  return fuse::dempster_two(x, y, z, conflict, a.cells());
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
  std::int64_t stamp_ns = inputs[0]->stamp_ns;
  for (const Layer* layer : inputs) stamp_ns = std::max(stamp_ns, layer->stamp_ns);
  const Layer& first = *inputs[0];
  const float error_bound = inputs.size() == 1 ? first.error_bound : 0.0f;
  // Takes the shape only where `out` is no input: an input has it.
  if (std::find(inputs.begin(), inputs.end(), &out) == inputs.end())
    out.reshape(first.channels(), first.step());
  if (!type.is_evidence() && (rule == Rule::kDempster || rule == Rule::kYager)) rule = Rule::kMean;

  CombineReport report;
  if (inputs.size() == 1) {
    for (int c = 0; c < first.channels() && &first != &out; ++c) {
      std::copy_n(first.plane(c).data(), first.cells(), out.plane(c).data());
    }
    if (conflict != nullptr) std::fill_n(conflict, first.cells(), 0.0f);
  } else if (inputs.size() == 2 && type.is_occupancy() && rule == Rule::kDempster) {
    report.total_conflicts = combine_two(first, *inputs[1], out, conflict);
  } else {
    report.total_conflicts = fuse::combine_blocks(inputs, type, rule, out, conflict);
  }
  out.stamp_ns = stamp_ns;
  out.error_bound = error_bound;
  return report;
}

void discount(Layer& layer, const LayerType& type, float alpha) {
  if (!(alpha >= 0.0f && alpha <= 1.0f)) {
    throw Error(ErrorCode::kInvalidArgument, "a discount factor lies between 0 and 1");
  }
  if (!type.is_evidence() || alpha == 1.0f) return;
  const int masses = static_cast<int>(type.hypotheses.size());
  for (int c = 0; c < masses; ++c) {
    for (float& m : layer.plane(c)) m *= alpha;
  }
  if (!type.stores_omega()) return;
  // 1 - alpha + alpha m, in the form that keeps m(Omega) = 1 exact.
  for (float& m : layer.plane(masses)) m = 1.0f - alpha * (1.0f - m);
}

}  // namespace apgm
