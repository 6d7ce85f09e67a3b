#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <deque>
#include <memory>

#include "apgm/format/reader.hpp"
#include "apgm/format/writer.hpp"
#include "apgm/ops/apply.hpp"
#include "apgm/ops/copy.hpp"
#include "apgm/ops/merge.hpp"
#include "tools/common/app.hpp"
#include "tools/common/conflict_picture.hpp"
#include "tools/common/exit_code.hpp"
#include "tools/common/input_head.hpp"
#include "tools/common/options.hpp"
#include "tools/common/picture.hpp"
#include "tools/common/report.hpp"
#include "tools/common/scratch.hpp"
#include "tools/common/stream.hpp"
#include "tools/common/suggest.hpp"

namespace apgm::tools {
namespace {

constexpr const char* kFusionGroup = "Fusion";

class MergeTool final : public Tool {
 public:
  ToolInfo info() const override {
    return {
        .verb = "merge",
        .summary = "fuse maps into one",
        .usage = "[OPTIONS] INPUT... -o OUTPUT",
        .details = {"Layers of the same type are brought to one cell size, then fused cell by cell. The "
                    "result is the same, byte for byte, for any order of the inputs (--rule last "
                    "excepted) and any number of threads. Layers that one input alone holds are copied "
                    "as they are stored.",
                    "Inputs must have the same patch edge, CRS and frame id, and datums that differ by "
                    "whole cells; --regrid lifts the first and the last.",
                    "With --apply the one input is the base of a delta that 'apgm-diff --delta' made. The "
                    "output is the map the delta leads to; a delta for another base is refused, as is a "
                    "delta as a stream that lacks a block."},
        .examples = {{"apgm-merge monday.apgm tuesday.apgm -o site.apgm", "two maps by Dempster's rule"},
                     {"apgm-merge a.apgm b.apgm --discount b.apgm=0.8 -o ab.apgm",
                      "trust the second map less"},
                     {"apgm-merge a.apgm b.apgm --conflict-map conflict.png -o ab.apgm",
                      "also draw where the maps contradict each other"},
                     {"apgm-merge --apply today.apgm yesterday.apgm -o new.apgm",
                      "bring a map up to date with a delta"},
                     {"ssh host cat today.apgms | apgm-merge --apply - yesterday.apgm -o new.apgm",
                      "the same from a stream of changes"}},
        .exit_codes = {{kExitOutput, "the output exists, is not permitted, or the disk is full"},
                       {kExitLimit, "a limit of the format or the budget is met"},
                       {kExitIncompatible, "the inputs do not fit together"}}};
  }

  void add_options(CLI::App& app) override {
    add_text(app, kFusionGroup, "--rule", rule_, "NAME", "dempster (default), yager, mean, max or last");
    add_list(app, kFusionGroup, "--discount", discounts_, "INPUT=ALPHA",
             "trust an input by a factor from 0 to 1 (repeatable)");
    add_text(app, kFusionGroup, "--resolution", resolution_, "M",
             "largest cell size of the result in metres (default: the finest present)");
    add_switch(app, kFusionGroup, "--regrid", options_.regrid,
               "resample inputs by area onto one grid where their edges or datums do not fit");
    add_text(app, kFusionGroup, "--assume-frame", options_.assume_frame_id, "ID",
             "take all inputs as being in this frame");
    add_text(app, kFusionGroup, "--conflict-map", picture_path_, "FILE.png",
             "also draw where the inputs contradict each other: white K = 0, black K = 1");
    add_list(app, "Deltas", "--apply", deltas_, "DELTA",
             "bring the one input to the map that a delta leads to (repeatable, in their order)");
    output_.add(app);
    writing_.add(app);
    heavy_.add(app);
  }

  void check(Session& session, const std::vector<std::string>& inputs) override {
    inputs_ = inputs;
    check_inputs(inputs_);
    if (rule_) {
      options_.rule =
          *rule_from(parse_choice("--rule", *rule_, {"dempster", "yager", "mean", "max", "last"}));
    }
    if (resolution_) options_.resolution_m = parse_positive("--resolution", *resolution_);
    check_discounts();
    writing_.check();
    heavy_.check();
    std::vector<std::string> read = inputs_;
    read.insert(read.end(), deltas_.begin(), deltas_.end());
    if (!deltas_.empty()) check_apply(read);
    output_.check(session, read);
    warn_of_extension(session, output_.path, ".apgm");
    if (picture_path_) {
      check_second_output("--conflict-map", *picture_path_, output_, inputs_);
      warn_of_extension(session, *picture_path_, ".png");
    }
    warn_of_repetition(session);
  }

  void run(Session& session) override { deltas_.empty() ? merge(session) : apply(session); }

 private:
  void merge(Session& session) {
    std::deque<Reader> readers;
    std::vector<MergeInput> merged;
    Json& result = session.result();
    result["inputs"] = Json::array();
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      const std::string& path = inputs_[i];
      const Reader& reader = readers.emplace_back(path);
      step_opened(session, path, reader);
      if (holds_changes(reader.header())) {
        session.warning(
            fmt::format("'{}' holds changes of a map, not a whole one; --apply applies them", path));
      }
      merged.push_back({&reader, path, alphas_[i].value_or(1.0f)});
      result["inputs"].push_back(
          {{"path", path}, {"content_id", reader.content_id()}, {"patches", reader.summary().patches}});
      session.check_cancelled();
    }
    ConflictPicture conflicts;
    if (picture_path_) options_.conflict = &conflicts;
    options_.max_memory_bytes = session.memory_left(heavy_);
    const MergePlan plan(merged, options_);
    MapHeader header = plan.header();
    writing_.apply(header, {});
    result["rule"] = to_string(options_.rule);
    result["conflict_map"] = picture_path_ ? Json(*picture_path_) : Json();
    report_grid(session, header.frame);
    if (output_.dry_run) return report_dry_run(session, output_);
    std::optional<OutputFile> picture;
    if (picture_path_) picture.emplace(*picture_path_, output_.options());
    Writer writer(output_.path, header, writing_.options(output_));
    const MergeReport report = work_beside_picture(
        picture ? picture_bytes(merged, header.frame) : 0, session.run_options(heavy_, "merging"),
        [&](const RunOptions& run) { return plan.run(writer, run); });
    if (picture) draw(conflicts, header.frame, *picture);
    session.check_cancelled();
    if (picture) picture->flush();  // a full disk must show before the map replaces an old one
    writer.finish();
    if (picture) picture->commit();
    result["layers_stored"] = report.layers_stored;
    result["total_conflicts"] = report.total_conflicts;
    if (report.total_conflicts > 0) {
      session.warning(fmt::format("{} in total conflict (K = 1) and became unknown",
                                  plural(report.total_conflicts, "cell was", "cells were")));
    }
    session.step(fmt::format("{} of {} layers copied as stored, {} in total conflict", report.layers_stored,
                             report.layers, plural(report.total_conflicts, "cell", "cells")));
    report_written(session, output_, writer.report());
  }

  std::uint64_t picture_bytes(const std::vector<MergeInput>& inputs, const Frame& frame) const {
    const int most_step = options_.resolution_m ? frame.step_for(*options_.resolution_m) : kMaxStep;
    return ConflictPicture::most_bytes(inputs, frame, most_step);
  }

  void check_apply(const std::vector<std::string>& read) const {
    if (inputs_.size() > 1) {
      throw usage_error(fmt::format("--apply takes one map, the base, not {}", inputs_.size()),
                        "several deltas are given by several --apply, in their order");
    }
    const std::pair<const char*, bool> given[] = {{"--rule", rule_.has_value()},
                                                  {"--discount", !discounts_.empty()},
                                                  {"--resolution", resolution_.has_value()},
                                                  {"--regrid", options_.regrid},
                                                  {"--assume-frame", options_.assume_frame_id.has_value()},
                                                  {"--conflict-map", picture_path_.has_value()},
                                                  {"--lossy", writing_.lossy != Lossy::kNone}};
    for (const auto& [name, is_given] : given) {
      if (!is_given) continue;
      throw usage_error(fmt::format("{} does not go with --apply", name),
                        "a delta leads to one map, cell by cell; merge or convert the result");
    }
    check_inputs(read);
  }

  using Sources = std::vector<std::unique_ptr<PatchSource>>;

  /// The map that a delta, as a file or a stream, leads to. `held` keeps it and what it reads.
  const PatchSource* apply_one(Session& session, const PatchSource& base, const ApplyNames& names,
                               Sources& held, Json& told) const {
    const std::string& path = names.delta;
    try {
      if (is_stream_input(path, head_of(path))) {
        held.push_back(apply_stream(session, base, names, scratch_directory(output_.path), told));
        return held.back().get();
      }
      held.push_back(std::make_unique<Reader>(path));
      const PatchSource& delta = *held.back();
      step_opened(session, path, delta);
      held.push_back(std::make_unique<AppliedSource>(base, delta, names));
    } catch (Error& e) {
      throw e.at(path);
    }
    return held.back().get();
  }

  /// Brings the base from delta to delta.
  void apply(Session& session) {
    const Reader base(inputs_[0]);
    step_opened(session, inputs_[0], base);
    Json& result = session.result();
    result["base"] = {{"path", inputs_[0]}, {"content_id", base.content_id()}};
    result["deltas"] = Json::array();
    Sources held;
    const PatchSource* map = &base;
    ApplyNames names{inputs_[0], {}};
    for (const std::string& path : deltas_) {
      names.delta = path;
      Json told = {{"path", path}};
      map = apply_one(session, *map, names, held, told);
      told["result_content_id"] = map->content_id();
      result["deltas"].push_back(std::move(told));
      names.base = "the map before it";
      session.check_cancelled();
    }
    MapHeader header = map->header();
    writing_.apply(header, {});
    if (output_.dry_run) return report_dry_run(session, output_);
    Writer writer(output_.path, header, writing_.options(output_));
    const CopyReport report =
        copy(*map, header.types, writer, writing_.reencode(), session.run_options(heavy_, "applying"));
    session.check_cancelled();
    writer.finish();
    result["layers_stored"] = report.layers_stored;
    session.step(fmt::format("{} of {} layers copied as stored", report.layers_stored, report.layers));
    report_written(session, output_, writer.report());
  }

  void check_discounts() {
    alphas_.assign(inputs_.size(), {});
    for (const auto& [path, text] : parse_pairs("--discount", discounts_, true)) {
      const auto alpha = static_cast<float>(parse_real("--discount " + path, text, 0, 1));
      bool known = false;
      for (std::size_t i = 0; i < inputs_.size(); ++i) {
        if (!same_file(path, inputs_[i])) continue;
        if (alphas_[i]) throw usage_error(fmt::format("--discount names '{}' twice", inputs_[i]));
        alphas_[i] = alpha;
        known = true;
      }
      if (known) continue;
      throw usage_error(fmt::format("--discount: '{}' is not an input", path),
                        did_you_mean(path, inputs_, "the inputs: " + join(inputs_)));
    }
  }

  void warn_of_repetition(Session& session) const {
    for (auto it = inputs_.begin(); it != inputs_.end(); ++it) {
      const auto first = std::find_if(inputs_.begin(), it, [&](const auto& o) { return same_file(o, *it); });
      if (first == it) continue;
      session.warning(*first == *it
                          ? fmt::format("'{}' is given twice and counts twice", *it)
                          : fmt::format("'{}' and '{}' are the same file, which counts twice", *first, *it));
    }
  }

  void report_grid(Session& session, const Frame& frame) const {
    const Point datum = frame.datum_m();
    session.result()["edge_m"] = frame.edge_m();
    session.result()["datum_m"] = {datum.x_m, datum.y_m};
    if (!options_.regrid) return;
    session.step(fmt::format("the result has patches of {} m and the datum ({}, {}) m",
                             number_text(frame.edge_m()), number_text(datum.x_m), number_text(datum.y_m)));
  }

  static void draw(const ConflictPicture& conflicts, const Frame& frame, OutputFile& picture) {
    PictureText text;
    text.title = "conflict K of the inputs";
    text.facts = {"frame " + frame.frame_id};
    if (frame.epsg) text.facts.push_back(fmt::format("EPSG:{}", *frame.epsg));
    text.up = frame.epsg ? "N" : "y";
    text.no_data = "the inputs share no layer of a patch";
    write_png(compose(conflicts.rendering(frame), text), picture);
  }

  std::vector<std::string> inputs_, discounts_, deltas_;
  std::vector<std::optional<float>> alphas_;  // by input
  std::optional<std::string> rule_, resolution_, picture_path_;
  MergeOptions options_;
  OutputChoice output_;
  MapWriting writing_;
  HeavyOptions heavy_;
};

}  // namespace
}  // namespace apgm::tools

int main(int argc, char** argv) {
  apgm::tools::MergeTool tool;
  return apgm::tools::run_tool(tool, argc, argv);
}
