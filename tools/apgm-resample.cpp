#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>

#include "apgm/format/reader.hpp"
#include "apgm/format/writer.hpp"
#include "apgm/observe/profile.hpp"
#include "apgm/ops/resample_map.hpp"
#include "converters/common/file.hpp"
#include "tools/common/app.hpp"
#include "tools/common/exit_code.hpp"
#include "tools/common/grid.hpp"
#include "tools/common/options.hpp"
#include "tools/common/report.hpp"
#include "tools/common/suggest.hpp"

namespace apgm::tools {
namespace {

constexpr const char* kTargetGroup = "Target";
constexpr const char* kLossGroup = "Loss";

std::vector<std::string> policy_names() {
  std::vector<std::string> names;
  for (int p = 0; p <= static_cast<int>(Policy::kMaximum); ++p) {
    names.emplace_back(to_string(static_cast<Policy>(p)));
  }
  return names;
}

constexpr std::uint64_t kMaxYamlBytes = std::uint64_t{1} << 20;

/// Takes a map for what can be told of it only.
class NoMap final : public PatchSink {
 public:
  explicit NoMap(const TypeTable& types) : types_(types) {}
  bool takes_stored() const override { return true; }
  void pack(Parcel& parcel) const override {
    if (parcel.state != Parcel::State::kCells) return;
    if (is_vacuous(parcel.cells, types_[parcel.type])) parcel.state = Parcel::State::kNothing;
  }
  void put(PatchIndex /*index*/, std::span<Parcel> /*parcels*/) override {}
  void finish() override {}

 private:
  const TypeTable& types_;
};

/// The requirements of `path`: of the profile called `name`, or of the only one.
Profile read_profile(const std::string& path, const std::optional<std::string>& name) {
  const Schedule schedule = parse_profiles(converters::read_file(path, kMaxYamlBytes), path);
  std::vector<std::string> names;
  for (const Schedule::Entry& entry : schedule.entries) {
    if (name ? entry.profile.name == *name : schedule.entries.size() == 1) return entry.profile;
    if (std::ranges::find(names, entry.profile.name) == names.end()) names.push_back(entry.profile.name);
  }
  if (!name) {
    throw usage_error(fmt::format("'{}' holds several profiles: {}", path, join(names)),
                      "choose one with --profile-name NAME");
  }
  throw usage_error(fmt::format("'{}' holds no profile '{}'", path, *name),
                    did_you_mean(*name, names, "its profiles: " + join(names)));
}

Json profile_json(const Profile& profile) {
  Json requirements = Json::array();
  for (const Requirement& r : profile.requirements) {
    Json one = {{"layer", r.layer}, {"cell_m", r.cell_m}};
    if (const Ring* ring = std::get_if<Ring>(&r.area)) {
      one["ring_m"] = {ring->from_m, ring->to_m};
    } else {
      std::size_t corners = 0;
      for (const auto& part : std::get<Polygon>(r.area).rings) corners += part.size();
      one["polygon_corners"] = corners;
    }
    requirements.push_back(one);
  }
  return {{"name", profile.name}, {"requirements", requirements}};
}

class ResampleTool final : public Tool {
 public:
  ToolInfo info() const override {
    return {
        .verb = "resample",
        .summary = "bring a map to other cell sizes or another grid",
        .usage = "[OPTIONS] INPUT -o OUTPUT",
        .details =
            {"Finer layers are merged and coarser ones split, each by the policy of its type. Layers that "
             "have "
             "the step already are copied as they are stored. --edge and --datum regrid by area.",
             "Told with -v and in --json: a cell's loss is how far it changed by being put into the cell of "
             "the result that covers it. For evidence that is |BetP before - BetP after|, from 0 to 1, for "
             "numbers the difference in their unit. It is measured over the known cells of merged layers; "
             "splitting loses nothing, and regridding is not measured. Occupied cells that end up in one "
             "with "
             "BetP(O) <= 0.5 are counted, and warned of."},
        .examples = {{"apgm-resample --resolution 0.4 site.apgm -o coarse.apgm",
                      "all layers at 0.4 m or less"},
                     {"apgm-resample --step 5 --layer semantic site.apgm -o out.apgm",
                      "one layer at 32 x 32 cells a patch, the others as they are"},
                     {"apgm-resample --resolution 0.2 --max-loss 0.1 site.apgm -o out.apgm",
                      "only if no layer of a patch loses more than 0.1 on average"},
                     {"apgm-resample --profile road.yaml --at 120,45.5 site.apgm -o here.apgm",
                      "what a vehicle at this place needs"},
                     {"apgm-resample --edge 6.4 --datum 500000,5400000 site.apgm -o out.apgm",
                      "the same map on another grid"}},
        .exit_codes = {{kExitNo, "--max-loss is exceeded; nothing was written"},
                       {kExitOutput, "the output exists, is not permitted, or the disk is full"},
                       {kExitLimit, "a limit of the format or the budget is met"}}};
  }

  void add_options(CLI::App& app) override {
    add_text(app, kTargetGroup, "--resolution", resolution_, "M",
             "every layer to the largest cells that are no larger than this, in metres");
    add_text(app, kTargetGroup, "--step", step_, "R",
             "every layer to 2^R x 2^R cells a patch, R from 0 to 11");
    add_text(app, kTargetGroup, "--profile", profile_path_, "FILE.yaml",
             "every layer to what is required round --at: finer ones are merged, coarser ones stay, layers "
             "that nothing requires are left out");
    add_text(app, kTargetGroup, "--at", at_, "X,Y", "where the vehicle is, for --profile, in metres");
    add_text(app, kTargetGroup, "--profile-name", profile_name_, "NAME",
             "the profile to take where the file holds several");
    add_text(app, kTargetGroup, "--edge", edge_, "M", "regrid to patches of this size in metres");
    add_text(app, kTargetGroup, "--datum", datum_, "X,Y", "regrid to this datum in metres of the map's CRS");
    add_text(
        app, kTargetGroup, "--policy", policy_, "NAME",
        "merge and split by this policy in place of the types' own, and store it: " + join(policy_names()));
    add_list(app, kTargetGroup, "--layer", options_.layers, "NAME",
             "resample only this layer, pass the others as they are (repeatable)");
    add_text(
        app, kLossGroup, "--max-loss", max_loss_, "X|none|any",
        "write nothing and exit with 1 if the mean loss of any layer of a patch exceeds X, 0 to 1; only "
        "none, the same as 0, also bounds numbers and refuses to leave layers out; a dry run measures the "
        "loss, too (default: any)");
    output_.add(app);
    writing_.add(app);
    heavy_.add(app);
  }

  void check(Session& session, const std::vector<std::string>& inputs) override {
    input_ = one_input(inputs);
    check_target();
    if (policy_) options_.policy = policy_from(parse_choice("--policy", *policy_, policy_names()));
    if (max_loss_) check_max_loss();
    writing_.check();
    heavy_.check();
    std::vector<std::string> read{input_};
    if (profile_path_) read.push_back(*profile_path_);
    output_.check(session, read);
    warn_of_extension(session, output_.path, ".apgm");
  }

  void run(Session& session) override {
    const Reader source(input_);
    step_opened(session, input_, source);
    warn_of_delta(session, input_, source.header());
    if (profile_) apply_profile(session, source.header());
    options_.max_memory_bytes = session.memory_left(heavy_);
    const ResamplePlan plan(source, options_);
    MapHeader header = plan.header();
    writing_.apply(header, {});
    Json& result = session.result();
    result["input"] = {{"path", input_}, {"content_id", source.content_id()}};
    result["edge_m"] = header.frame.edge_m();
    result["datum_m"] = {header.frame.datum_m().x_m, header.frame.datum_m().y_m};
    note_largest_cell(session, header.frame);
    if (output_.dry_run) {
      if (bound_) {
        NoMap sink(header.types);
        tell(session, header.types, run(session, plan, header.types, sink), true);
      } else {
        tell(session, header.types, plan.expected(), false);
        session.done("the loss was not measured: --max-loss has a dry run measure it");
      }
      session.check_cancelled();
      return report_dry_run(session, output_);
    }
    session.check_cancelled();
    Writer writer(output_.path, header, writing_.options(output_));
    const ResampleReport report = run(session, plan, header.types, writer);
    session.check_cancelled();
    writer.finish();
    tell(session, header.types, report, true);
    result["layers_stored"] = report.layers_stored;
    session.step(fmt::format("{} copied as stored", plural(report.layers_stored, "layer", "layers")));
    report_written(session, output_, writer.report());
  }

 private:
  ResampleReport run(Session& session, const ResamplePlan& plan, const TypeTable& types,
                     PatchSink& sink) const {
    return plan.run(sink, session.run_options(heavy_, "resampling"),
                    [&](const ResampledLayer& layer) { refuse_loss(layer, types); });
  }

  void check_target() {
    const bool regrids = edge_ || datum_;
    std::vector<std::string> ways;
    if (resolution_) ways.emplace_back("--resolution");
    if (step_) ways.emplace_back("--step");
    if (profile_path_) ways.emplace_back("--profile");
    if (ways.size() > 1) throw usage_error(fmt::format("{} and {} exclude each other", ways[0], ways[1]));
    if (ways.empty() && !regrids) {
      throw usage_error("there is nothing to resample to",
                        "pass --resolution, --step, --profile, --edge or --datum");
    }
    if (profile_path_ && !at_) throw usage_error("--profile needs --at X,Y, where the vehicle is");
    if (!profile_path_ && (at_ || profile_name_)) {
      throw usage_error(
          fmt::format("{} is for --profile, which is not given", at_ ? "--at" : "--profile-name"));
    }
    if (regrids) check_regrid();
    if (profile_path_) {
      at_m_ = parse_point("--at", *at_, kMaxCoordinate_m);
      if (*profile_path_ == "-") throw usage_error("--profile takes the name of a file");
      profile_ = read_profile(*profile_path_, profile_name_);
    }
    if (resolution_) options_.resolution_m = parse_positive("--resolution", *resolution_);
    if (step_) {
      options_.step = static_cast<int>(
          parse_integer("--step", *step_, 0, kMaxStep, "a layer of step R has 2^R x 2^R cells a patch"));
    }
    if (edge_) options_.edge_um = whole_micrometres("--edge", parse_real("--edge", *edge_, 1e-3, 1e4));
    if (datum_) {
      const Point p = parse_point("--datum", *datum_, 1e9);
      options_.datum_um = {whole_micrometres("--datum", p.x_m), whole_micrometres("--datum", p.y_m)};
    }
  }

  void check_regrid() const {
    if (profile_path_) {
      throw usage_error("--profile does not go with --edge or --datum",
                        "regrid first, then apply the profile");
    }
    if (!options_.layers.empty()) {
      throw usage_error("--layer does not go with --edge or --datum: all layers of a map lie on one grid",
                        "regrid first, then resample a layer");
    }
    if (max_loss_) {
      throw usage_error(
          "--max-loss does not go with --edge or --datum: the loss of a regridding is not measured");
    }
  }

  /// The rule of the profile for this map, and what the history and the document tell of it.
  void apply_profile(Session& session, const MapHeader& header) {
    try {
      profile_->check(header.frame, header.types);
    } catch (const Error& error) {
      throw Error(error.code(), fmt::format("'{}': {}", *profile_path_, error.message()))
          .hint(error.hint())
          .at(*profile_path_);
    }
    profile_in_frame_.emplace(*profile_, header.frame);
    options_.rule = [this, &header](const LayerInfo& layer) -> std::optional<int> {
      const auto step = profile_in_frame_->required_step(layer.patch, header.types[layer.type].name, at_m_);
      return step ? std::optional<int>(std::min<int>(*step, layer.step)) : std::nullopt;
    };
    const Json told = profile_json(*profile_), at = {at_m_.x_m, at_m_.y_m};
    options_.told = {{"profile", parameters_text(told)}, {"at_m", parameters_text(at)}};
    session.result()["profile"] = told;
    session.result()["at_m"] = at;
  }

  void check_max_loss() {
    if (*max_loss_ == "any") return;
    if (*max_loss_ == "none") {
      bound_ = 0;
      return;
    }
    try {
      bound_ = parse_real("--max-loss", *max_loss_, 0, 1);
    } catch (Error& error) {
      throw error.hint("none is the same as 0, any sets no bound");
    }
  }

  void note_largest_cell(Session& session, const Frame& frame) const {
    if (!options_.resolution_m || *options_.resolution_m < 2 * frame.edge_m()) return;
    session.note(fmt::format("no cell is larger than a patch: cells of {} m", number_text(frame.edge_m())));
  }

  void refuse_loss(const ResampledLayer& layer, const TypeTable& types) const {
    if (!bound_) return;
    const LayerType& type = types[layer.type];
    const bool bounded = type.is_evidence() || *bound_ == 0;
    const bool dropped = *bound_ == 0 && !layer.to;
    if (!dropped && !(bounded && layer.loss.mean() > *bound_)) return;
    throw AnswerNo(fmt::format("layer '{}' of patch ({},{}) {}", type.name, layer.patch.x, layer.patch.y,
                               dropped ? std::string("would be left out")
                                       : fmt::format("would lose {:.3g} on average, more than {}",
                                                     layer.loss.mean(), number_text(*bound_))),
                   output_.path == "-"
                       ? "what went to standard output is not whole; --max-loss any accepts the loss"
                       : "nothing was written; --max-loss any accepts the loss");
  }

  /// What became of each type. `measured`: the map was resampled, not only planned.
  void tell(Session& session, const TypeTable& types, const ResampleReport& report, bool measured) const {
    Json rows = Json::array();
    for (std::size_t t = 0; t < types.size(); ++t) {
      const LayerType& type = types[static_cast<TypeId>(t)];
      rows.push_back(row(type, report.types[t], measured));
      tell_type(session, type, report.types[t]);
    }
    session.result()["types"] = rows;
    session.result()["patches_dropped"] = report.patches_dropped;
    session.result()["patches_emptied"] = measured ? Json(report.patches_emptied) : Json();
    warn_of_nothing(session, report);
  }

  /// An answer that is empty though the map is not is seldom meant.
  void warn_of_nothing(Session& session, const ResampleReport& report) const {
    std::uint64_t before = 0, after = 0;
    for (const ResampleReport::OfType& r : report.types) {
      before += r.cells_before;
      after += r.cells_after;
    }
    if (before == 0 || after > 0) return;
    session.warning(profile_ ? fmt::format("the profile requires nothing that the map has round ({}, {}) m",
                                           number_text(at_m_.x_m), number_text(at_m_.y_m))
                             : std::string("no layer of the map comes out with data"));
  }

  static Json row(const LayerType& type, const ResampleReport::OfType& r, bool measured) {
    Json json = {
        {"name", type.name},
        {"policy", to_string(type.policy)},
        {"layers_merged", r.layers_merged},
        {"layers_split", r.layers_split},
        {"layers_unchanged", r.layers_unchanged},
        {"layers_dropped", r.layers_dropped},
        {"layers_regridded", r.layers_regridded},
        {"layers_emptied", measured && r.layers_regridded == 0 ? Json(r.layers_emptied) : Json()},
        {"cells_before", r.cells_before},
        {"cells_after", r.cells_after},
        {"loss", Json()},
        {"obstacles_lost",
         measured && r.layers_regridded == 0 && type.is_occupancy() ? Json(r.loss.obstacles) : Json()}};
    if (!measured || r.loss.known_cells == 0) return json;
    json["loss"] = {{"of", type.is_evidence() ? "belief" : "value"},
                    {"known_cells", r.loss.known_cells},
                    {"mean", r.loss.mean()},
                    {"max", r.loss.most},
                    {"worst_layer", Json()}};
    if (r.worst.sum > 0) {
      json["loss"]["worst_layer"] = {{"patch", {r.worst_patch.x, r.worst_patch.y}}, {"mean", r.worst.mean()}};
    }
    return json;
  }

  static void tell_type(Session& session, const LayerType& type, const ResampleReport::OfType& r) {
    std::vector<std::string> parts;
    const auto part = [&](std::uint64_t n, const char* what) {
      if (n > 0) parts.push_back(fmt::format("{} {}", plural(n, "layer", "layers"), what));
    };
    part(r.layers_merged, "merged");
    part(r.layers_split, "split");
    part(r.layers_unchanged, "unchanged");
    part(r.layers_regridded, "regridded");
    part(r.layers_dropped, "left out");
    if (parts.empty()) return;
    std::string text = fmt::format("{}: {}; ", type.name, join(parts));
    const std::string before = plural(r.cells_before, "cell", "cells");
    text += r.cells_after == 0 ? fmt::format("nothing of {} is kept", before)
                               : fmt::format("{} became {}", before, count_text(r.cells_after));
    if (r.loss.known_cells > 0) {
      text += fmt::format("; {} changed by {:.3g} on average, {:.3g} at most",
                          type.is_evidence() ? "belief" : "values", r.loss.mean(), r.loss.most);
    }
    if (r.worst.sum > 0) {
      text += fmt::format("; most in patch ({},{}), by {:.3g} on average", r.worst_patch.x, r.worst_patch.y,
                          r.worst.mean());
    }
    session.done(text);
    if (r.layers_dropped > 0) {
      const bool one = r.layers_dropped == 1;
      session.note(fmt::format("{} {} of '{}' {} not required by the profile and left out",
                               count_text(r.layers_dropped), one ? "layer" : "layers", type.name,
                               one ? "is" : "are"));
    }
    if (r.layers_emptied > 0) {
      const bool one = r.layers_emptied == 1;
      session.note(fmt::format("{} {} of '{}' {} out without data by policy '{}' and {} not in the result",
                               count_text(r.layers_emptied), one ? "layer" : "layers", type.name,
                               one ? "comes" : "come", to_string(type.policy), one ? "is" : "are"));
    }
    if (r.loss.obstacles > 0) {
      const bool one = r.loss.obstacles == 1;
      session.warning(
          fmt::format("{} occupied {} of '{}' {} no longer occupied: BetP(O) <= 0.5 by policy '{}'",
                      count_text(r.loss.obstacles), one ? "cell" : "cells", type.name, one ? "is" : "are",
                      to_string(type.policy)));
    }
  }

  std::string input_;
  std::optional<std::string> resolution_, step_, edge_, datum_, policy_, max_loss_;
  std::optional<std::string> profile_path_, profile_name_, at_;
  std::optional<Profile> profile_;
  std::optional<ProfileInFrame> profile_in_frame_;
  Point at_m_;
  std::optional<double> bound_;  ///< of the mean loss of a layer; empty: none
  ResampleOptions options_;
  OutputChoice output_;
  MapWriting writing_;
  HeavyOptions heavy_;
};

}  // namespace
}  // namespace apgm::tools

int main(int argc, char** argv) {
  apgm::tools::ResampleTool tool;
  return apgm::tools::run_tool(tool, argc, argv);
}
