#include <algorithm>
#include <set>
#include <tuple>
#include <utility>

#include "apgm/core/summary.hpp"
#include "apgm/fuse/framework.hpp"
#include "apgm/fuse/regrid.hpp"
#include "merge_state.hpp"
#include "provenance.hpp"
#include "shifted_source.hpp"
#include "transfer.hpp"

namespace apgm {
namespace {

using Inputs = std::vector<MergeInput>;

[[noreturn]] void fail(const MergeInput& a, const MergeInput& b, const std::string& why, std::string hint) {
  throw Error(ErrorCode::kIncompatible, "cannot merge '" + a.name + "' and '" + b.name + "': " + why)
      .hint(std::move(hint));
}

std::string metres(std::int64_t um) { return ops::json_number(static_cast<double>(um) / 1e6) + " m"; }

std::string datum_text(const Frame& f) {
  return "(" + metres(f.datum_x_um) + ", " + metres(f.datum_y_um) + ")";
}

const Frame& frame_of(const MergeInput& input) { return input.source->header().frame; }

void check(const Inputs& inputs) {
  if (inputs.empty()) throw Error(ErrorCode::kInvalidArgument, "there is nothing to merge");
  for (const MergeInput& input : inputs) {
    if (input.alpha >= 0.0f && input.alpha <= 1.0f) continue;
    throw Error(ErrorCode::kInvalidArgument, "the discount of '" + input.name + "' does not lie in [0, 1]");
  }
}

/// Inputs that hold patches, or all if none does.
std::vector<const MergeInput*> voters(const Inputs& inputs) {
  std::vector<const MergeInput*> with, all;
  for (const MergeInput& input : inputs) {
    all.push_back(&input);
    if (input.source->summary().patches > 0) with.push_back(&input);
  }
  return with.empty() ? all : with;
}

void join_frame_ids(const Inputs& inputs, const MergeOptions& options, Frame& frame) {
  frame.frame_id = options.assume_frame_id.value_or(frame_of(inputs[0]).frame_id);
  if (options.assume_frame_id) return;
  for (const MergeInput& input : inputs) {
    const std::string& id = frame_of(input).frame_id;
    if (id == frame.frame_id) continue;
    fail(inputs[0], input, "frames differ ('" + frame.frame_id + "' and '" + id + "')",
         "pass --assume-frame " + frame.frame_id + " if they are the same");
  }
}

void join_epsg(const Inputs& inputs, Frame& frame, std::vector<Finding>& findings) {
  const MergeInput* known = nullptr;
  for (const MergeInput& input : inputs) {
    const auto epsg = frame_of(input).epsg;
    if (!epsg) continue;
    if (known != nullptr && *frame_of(*known).epsg != *epsg) {
      fail(*known, input,
           "coordinate reference systems differ (EPSG " + std::to_string(*frame_of(*known).epsg) + " and " +
               std::to_string(*epsg) + ")",
           "bring them to one coordinate reference system first");
    }
    if (known == nullptr) known = &input;
  }
  if (known == nullptr) return;
  frame.epsg = frame_of(*known).epsg;
  for (const MergeInput& input : inputs) {
    if (frame_of(input).epsg) continue;
    findings.push_back({Finding::Kind::kNote, "'" + input.name + "' does not say its EPSG code; taken as " +
                                                  std::to_string(*frame.epsg) + ", as in '" + known->name +
                                                  "'"});
  }
}

/// Edge and datum of the result: the smallest of each, so that no order of inputs matters.
const MergeInput& lead(const std::vector<const MergeInput*>& voters) {
  return **std::ranges::min_element(voters, [](const MergeInput* a, const MergeInput* b) {
    const Frame &f = frame_of(*a), &g = frame_of(*b);
    return std::tie(f.edge_um, f.datum_x_um, f.datum_y_um) < std::tie(g.edge_um, g.datum_x_um, g.datum_y_um);
  });
}

/// `input` on the grid of `target`: nullptr where it lies on it already.
std::unique_ptr<PatchSource> aligned(const MergeInput& input, const MergeInput& first, const Frame& target,
                                     const MergeOptions& options, RegridBudget& budget) {
  const Frame& frame = frame_of(input);
  const bool same_edge = frame.edge_um == target.edge_um;
  if (same_edge && frame.datum_x_um == target.datum_x_um && frame.datum_y_um == target.datum_y_um) return {};
  if (same_edge) {
    const int step = coarsest_step(input.source->summary()).value_or(kMaxStep);
    if (const auto offset = ops::whole_cells(frame, target, step)) {
      return std::make_unique<ops::ShiftedSource>(*input.source, target, *offset);
    }
  }
  if (options.regrid) return regrid(*input.source, target, {}, {}, &budget);
  const char* hint = "pass --regrid to resample by area onto one grid; cells then change";
  if (!same_edge) {
    fail(first, input,
         "patch edges differ (" + metres(target.edge_um) + " and " + metres(frame.edge_um) + ")", hint);
  }
  fail(first, input,
       "datums differ by other than whole cells (" + datum_text(target) + " and " + datum_text(frame) + ")",
       hint);
}

TypeTable join_types(const Inputs& inputs) {
  std::vector<const TypeTable*> tables;
  for (const MergeInput& input : inputs) tables.push_back(&input.source->header().types);
  return fused_types(tables);
}

void map_types(const TypeTable& to, MergePlan::State::Lane& lane) {
  for (const LayerType& type : lane.source->header().types) {
    const TypeId id = *to.find(type.name);
    lane.types.push_back(id);
    lane.stored_ok.push_back(type.same_backgrounds(to[id]));
  }
}

std::map<std::string, std::string> shared_metadata(const Inputs& inputs) {
  std::map<std::string, std::string> shared = inputs[0].source->header().metadata;
  for (const MergeInput& input : inputs) {
    const auto& own = input.source->header().metadata;
    std::erase_if(shared, [&](const auto& pair) {
      const auto it = own.find(pair.first);
      return it == own.end() || it->second != pair.second;
    });
  }
  return shared;
}

std::vector<Provenance> joined_history(const Inputs& inputs, const MergeOptions& options) {
  std::vector<std::pair<std::string, float>> trusts;
  for (const MergeInput& input : inputs) trusts.emplace_back(ops::input_id(*input.source), input.alpha);
  if (options.rule != Rule::kLast) std::ranges::sort(trusts);

  Provenance step;
  step.operation = "merge";
  std::vector<std::string> alphas;
  for (const auto& [id, alpha] : trusts) {
    step.inputs.push_back(id);
    alphas.push_back(ops::json_number(alpha));
  }
  std::map<std::string, std::string> members;
  members["rule"] = ops::json_text(std::string(to_string(options.rule)));
  if (options.resolution_m) members["resolution_m"] = ops::json_number(*options.resolution_m);
  if (options.regrid) members["regrid"] = "true";
  if (std::ranges::any_of(inputs, [](const MergeInput& i) { return i.alpha < 1.0f; })) {
    members["discounts"] = ops::json_list(alphas);
  }
  step.parameters = ops::json_object(members);

  const auto& first = inputs[0].source->header().history;
  const bool equal =
      std::ranges::all_of(inputs, [&](const MergeInput& i) { return i.source->header().history == first; });
  std::vector<Provenance> history = equal ? first : std::vector<Provenance>{};
  history.push_back(std::move(step));
  return history;
}

}  // namespace

MergePlan::MergePlan(std::vector<MergeInput> inputs, MergeOptions options) {
  check(inputs);
  auto state = std::make_unique<State>();
  MapHeader& header = state->header;
  const auto voting = voters(inputs);
  const MergeInput& first = lead(voting);
  header.frame = frame_of(first);
  join_frame_ids(inputs, options, header.frame);
  join_epsg(inputs, header.frame, state->findings);
  header.frame.check();
  if (options.resolution_m) state->required = header.frame.step_for(*options.resolution_m);
  header.types = join_types(inputs);
  header.metadata = shared_metadata(inputs);
  header.history = joined_history(inputs, options);
  for (const MergeInput& input : inputs) {
    header.stamp_ns = std::max(header.stamp_ns, input.source->header().stamp_ns);
  }
  RegridBudget budget{options.max_memory_bytes};
  for (const MergeInput* input : voting) {
    State::Lane lane{input->source, input->source, input->alpha, input->name, {}, {}};
    if (auto adapter = aligned(*input, first, header.frame, options, budget)) {
      lane.source = adapter.get();
      if (const auto* shifted = dynamic_cast<const ops::ShiftedSource*>(lane.source)) {
        state->plan_bytes += shifted->plan_bytes();
      } else {
        lane.sizes = lane.source;
      }
      state->adapters.push_back(std::move(adapter));
    }
    map_types(header.types, lane);
    state->lanes.push_back(std::move(lane));
  }
  state->options = std::move(options);
  state_ = std::move(state);
}

MergePlan::~MergePlan() = default;
MergePlan::MergePlan(MergePlan&&) noexcept = default;
MergePlan& MergePlan::operator=(MergePlan&&) noexcept = default;

const MapHeader& MergePlan::header() const { return state_->header; }

MergeReport MergePlan::run(PatchSink& sink, const RunOptions& run) const {
  return ops::run_merge(*state_, sink, run);
}

}  // namespace apgm
