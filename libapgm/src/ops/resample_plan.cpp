#include <algorithm>
#include <utility>

#include "apgm/fuse/regrid.hpp"
#include "apgm/ops/apply.hpp"
#include "provenance.hpp"
#include "resample_state.hpp"
#include "resample_view.hpp"

namespace apgm {
namespace {

using State = ResamplePlan::State;

std::string names_of(const TypeTable& types) {
  std::string names;
  for (const LayerType& type : types) names += (names.empty() ? "" : ", ") + type.name;
  return names;
}

void choose(const TypeTable& types, State& state) {
  state.chosen.assign(types.size(), state.options.layers.empty());
  for (const std::string& name : state.options.layers) {
    const auto id = types.find(name);
    if (!id) {
      throw Error(ErrorCode::kInvalidArgument, "the map has no layer '" + name + "' to resample")
          .hint(types.empty() ? "the map has no layers" : "its layers: " + names_of(types));
    }
    state.chosen[*id] = true;
  }
}

bool fits(LayerType type, Policy policy) {
  type.policy = policy;
  try {
    type.check();
    return true;
  } catch (const Error&) {
    return false;
  }
}

std::string policies_for(const LayerType& type) {
  std::string names;
  for (int p = 0; p <= static_cast<int>(Policy::kMaximum); ++p) {
    const auto policy = static_cast<Policy>(p);
    if (fits(type, policy)) names += (names.empty() ? "" : ", ") + std::string(to_string(policy));
  }
  return names;
}

TypeTable with_policy(const TypeTable& types, Policy policy, const std::vector<bool>& chosen) {
  std::vector<LayerType> changed(types.begin(), types.end());
  for (std::size_t t = 0; t < changed.size(); ++t) {
    if (!chosen[t]) continue;
    if (!fits(changed[t], policy)) {
      throw Error(ErrorCode::kInvalidArgument, "the policy '" + std::string(to_string(policy)) +
                                                   "' does not fit layer '" + changed[t].name + "'")
          .hint("it takes: " + policies_for(changed[t]) + "; --layer limits what is resampled");
    }
    changed[t].policy = policy;
  }
  return TypeTable(std::move(changed));
}

Frame target_frame(const Frame& from, const ResampleOptions& options) {
  Frame frame = from;
  if (options.edge_um) frame.edge_um = *options.edge_um;
  if (options.datum_um) {
    frame.datum_x_um = (*options.datum_um)[0];
    frame.datum_y_um = (*options.datum_um)[1];
  }
  frame.check();
  return frame;
}

Provenance history_step(const PatchSource& source, const ResampleOptions& options) {
  std::map<std::string, std::string> members = options.told;
  const auto metres = [](std::int64_t um) { return ops::json_number(static_cast<double>(um) / 1e6); };
  if (options.resolution_m) members["resolution_m"] = ops::json_number(*options.resolution_m);
  if (options.step) members["step"] = std::to_string(*options.step);
  if (options.policy) members["policy"] = ops::json_text(std::string(to_string(*options.policy)));
  if (options.edge_um) members["edge_m"] = metres(*options.edge_um);
  if (options.datum_um) {
    const std::string xy[] = {metres((*options.datum_um)[0]), metres((*options.datum_um)[1])};
    members["datum_m"] = ops::json_list(xy);
  }
  if (!options.layers.empty()) {
    std::vector<std::string> names;
    for (const std::string& name : options.layers) names.push_back(ops::json_text(name));
    members["layers"] = ops::json_list(names);
  }
  return {"resample", {ops::input_id(source)}, ops::json_object(members)};
}

std::uint64_t bytes_of(const LayerType& type, int step) {
  return (std::uint64_t{sizeof(float)} << (2 * step)) * type.channels.size();
}

void check_step(const LayerType& type, int step) {
  if (step < 0 || step > kMaxStep) throw Error(ErrorCode::kLimit, "a resolution step lies in 0..11");
  const std::uint64_t bytes = bytes_of(type, step);
  if (bytes <= Layer::kMaxBytes) return;
  throw Error(ErrorCode::kLimit, "layer '" + type.name + "' would take " + std::to_string(bytes >> 20) +
                                     " MiB a patch at step " + std::to_string(step) + ", more than 64 MiB")
      .hint("choose larger cells, or resample other layers only");
}

/// Walks the index once: what becomes of each layer, and what memory that takes.
void foresee(const Summary& before, State& state) {
  const MapHeader& header = state.source->header();
  state.expected.types.resize(header.types.size());
  state.largest.resize(header.types.size());
  PatchInfo patch;
  for (const auto cursor = state.source->patches(); cursor->next(patch);) {
    ++state.patches;
    bool kept = false;
    for (const LayerInfo& layer : patch.layers) {
      const LayerType& type = header.types[layer.type];
      const std::optional<int> to = state.wanted(layer);
      if (to) check_step(type, *to);
      kept |= to.has_value();
      if (state.regridded) {
        auto& counts = state.expected.types[layer.type];
        ++counts.layers_regridded;
        counts.cells_after += std::uint64_t{1} << (2 * layer.step);
      } else {
        ops::tally(layer.step, to, state.expected.types[layer.type]);
      }
      std::uint64_t& largest = state.largest[layer.type];
      largest = std::max({largest, bytes_of(type, layer.step), to ? bytes_of(type, *to) : 0});
    }
    state.expected.patches_dropped += !kept;
  }
  if (!state.regridded) return;
  for (std::size_t t = 0; t < before.types.size(); ++t) {
    for (std::size_t step = 0; step < before.types[t].layers_at.size(); ++step) {
      const std::uint64_t layers = before.types[t].layers_at[step];
      if (layers == 0) continue;
      state.expected.types[t].cells_before += layers << (2 * step);
      const LayerType& type = header.types[static_cast<TypeId>(t)];
      state.largest[t] = std::max(state.largest[t], bytes_of(type, static_cast<int>(step)));
    }
  }
}

}  // namespace

namespace ops {

void tally(int from, std::optional<int> to, ResampleReport::OfType& type) {
  type.cells_before += std::uint64_t{1} << (2 * from);
  if (to) type.cells_after += std::uint64_t{1} << (2 * *to);
  ++(!to          ? type.layers_dropped
     : *to < from ? type.layers_merged
     : *to > from ? type.layers_split
                  : type.layers_unchanged);
}

}  // namespace ops

ResamplePlan::ResamplePlan(const PatchSource& source, ResampleOptions options) {
  if (options.resolution_m.has_value() + options.step.has_value() + (options.rule != nullptr) > 1) {
    throw Error(ErrorCode::kInvalidArgument, "a resolution, a step and a rule exclude each other");
  }
  auto state = std::make_unique<State>();
  state->options = std::move(options);
  const ResampleOptions& wanted = state->options;
  MapHeader& header = state->header;
  header = source.header();
  drop_changes(header);
  choose(header.types, *state);
  state->source = &source;
  const auto adapt = [&](std::unique_ptr<PatchSource> adapter) {
    state->source = adapter.get();
    state->adapters.push_back(std::move(adapter));
  };
  if (wanted.policy) {
    header.types = with_policy(header.types, *wanted.policy, state->chosen);
    if (header.types != source.header().types) {
      adapt(std::make_unique<ops::PolicyView>(source, header.types));
    }
  }
  header.frame = target_frame(header.frame, wanted);
  state->step = wanted.resolution_m ? header.frame.step_for(*wanted.resolution_m) : wanted.step;
  if (state->step) {
    for (std::size_t t = 0; t < header.types.size(); ++t) {
      if (state->chosen[t]) check_step(header.types[static_cast<TypeId>(t)], *state->step);
    }
  }
  if (header.frame != source.header().frame) {
    if (wanted.rule || !wanted.layers.empty()) {
      throw Error(ErrorCode::kInvalidArgument,
                  "all layers of a map lie on one grid, at one step if any is said");
    }
    state->regridded = true;
    RegridBudget budget{wanted.max_memory_bytes};
    adapt(regrid(*state->source, header.frame, {}, state->step, &budget));
  }
  header.history.push_back(history_step(source, wanted));
  foresee(source.summary(), *state);
  state_ = std::move(state);
}

ResamplePlan::~ResamplePlan() = default;
ResamplePlan::ResamplePlan(ResamplePlan&&) noexcept = default;
ResamplePlan& ResamplePlan::operator=(ResamplePlan&&) noexcept = default;

const MapHeader& ResamplePlan::header() const { return state_->header; }
const ResampleReport& ResamplePlan::expected() const { return state_->expected; }

ResampleReport ResamplePlan::run(PatchSink& sink, const RunOptions& run,
                                 const std::function<void(const ResampledLayer&)>& watch) const {
  return ops::run_resample(*state_, sink, run, watch);
}

}  // namespace apgm
