#include <fmt/format.h>

#include <CLI/App.hpp>

#include "apgm/core/budget.hpp"
#include "apgm/format/output_file.hpp"
#include "apgm/format/reader.hpp"
#include "apgm/ops/diff.hpp"
#include "tools/common/app.hpp"
#include "tools/common/blame_report.hpp"
#include "tools/common/delta_output.hpp"
#include "tools/common/diff_picture.hpp"
#include "tools/common/diff_report.hpp"
#include "tools/common/exit_code.hpp"
#include "tools/common/options.hpp"
#include "tools/common/picture.hpp"
#include "tools/common/report.hpp"

namespace apgm::tools {
namespace {

constexpr const char* kCompareGroup = "Comparison";
constexpr const char* kOutputGroup = "Output";
constexpr double kDefaultTolerance = 0.01;
constexpr std::int64_t kMostRegions = 1'000'000;

class DiffTool final : public Tool {
 public:
  ToolInfo info() const override {
    return {.verb = "diff",
            .summary = "tell what differs between two maps",
            .usage = "[OPTIONS] REF OTHER | --blame X,Y MERGED INPUT...",
            .details = {"Tells what became of REF in OTHER: patches and layers added, removed and changed; "
                        "cells by kind of change with their area; and how far the beliefs lie apart. Layers "
                        "of equal content are not read. Layers of two cell sizes are compared at the "
                        "coarser. docs/diff.md says what each figure means.",
                        "Levels: 'bytes' looks at the content hash of each layer and reads no cell; 'cells' "
                        "(default) counts every cell that differs in a bit; 'belief' those of which a mass "
                        "or value differs by more than --tolerance.",
                        "Stamps, metadata, history and policies are told where they differ, but make no "
                        "difference. Both maps need the same patch edge, CRS and frame id, and datums that "
                        "differ by whole cells.",
                        "--delta needs maps of the same frame, and looks at all of them whatever the other "
                        "options say. --blame asks another question: it follows the history of a merged map "
                        "to the inputs it was made of, and says which of those given hold data at a point. "
                        "docs/delta.md tells of both."},
            .examples = {{"apgm-diff monday.apgm tuesday.apgm", "what changed, for people"},
                         {"apgm-diff --level bytes a.apgm b.apgm", "the quick answer, by the exit code"},
                         {"apgm-diff --level belief --tolerance 0.2 --top 5 a.apgm b.apgm",
                          "the five largest changes that matter, as boxes for apgm-crop --bbox"},
                         {"apgm-diff a.apgm b.apgm --png changes.png", "and as a picture"},
                         {"apgm-diff a.apgm b.apgm --delta ab.apgm",
                          "and as a delta: 'apgm-merge --apply ab.apgm a.apgm -o b.apgm'"},
                         {"apgm-diff --blame 12.5,-3 site.apgm monday.apgm tuesday.apgm",
                          "who observed the point (12.5, -3) m"}},
            .exit_codes = {{kExitDone, "the maps are equal, as --level says; --blame named an input"},
                           {kExitNo, "the maps differ, as --level says; --blame named none"},
                           {kExitOutput, "an output exists, is not permitted, or the disk is full"},
                           {kExitLimit, "the budget is too small"},
                           {kExitIncompatible, "the maps do not fit together"}}};
  }

  void add_options(CLI::App& app) override {
    add_text(app, kCompareGroup, "--level", level_, "bytes|cells|belief", "when maps count as different");
    add_text(app, kCompareGroup, "--tolerance", tolerance_, "M",
             "of --level belief: what a mass or value may differ by (default 0.01)");
    add_text(app, kCompareGroup, "--top", top_text_, "N",
             "list the N regions with most changed area, as boxes for apgm-crop --bbox");
    filter_.add(app);
    add_text(app, kOutputGroup, "--png", picture_path_, "FILE.png",
             "draw what changed: the first --layer, else the first occupancy layer");
    delta_.add(app);
    add_switch(app, kOutputGroup, "-O,--overwrite", overwrite_, "replace existing files");
    blame_.add(app);
    heavy_.add(app);
  }

  void check(Session& session, const std::vector<std::string>& inputs) override {
    inputs_ = inputs;
    check_inputs(inputs_);
    if (blame_.asked()) return check_blame();
    if (inputs_.size() != 2) {
      throw usage_error(inputs_.size() == 1
                            ? "one map is given, two are compared"
                            : fmt::format("unexpected argument '{}': two maps are compared", inputs_[2]),
                        "apgm-diff REF OTHER");
    }
    check_level();
    if (top_text_) top_ = static_cast<std::size_t>(parse_integer("--top", *top_text_, 1, kMostRegions));
    filter_.check();
    options_.layers = filter_.layers;
    options_.box = filter_.box;
    options_.regions = top_ > 0;
    heavy_.check();
    delta_.check(session, inputs_, overwrite_);
    if (!picture_path_) return;
    if (*picture_path_ == "-") throw usage_error("--png is not written to standard output", "name a file");
    check_output_path(*picture_path_, overwrite_, inputs_);
    if (delta_.given() && same_file(*picture_path_, delta_.path())) {
      throw usage_error(fmt::format("--png and --delta are the same file '{}'", *picture_path_),
                        "name two files");
    }
    warn_of_extension(session, *picture_path_, ".png");
  }

  void run(Session& session) override {
    if (blame_.asked()) {
      if (!blame_.answer(session, inputs_)) session.answer_no();
      return;
    }
    const Reader reference(inputs_[0]), other(inputs_[1]);
    describe_inputs(session, reference, other);
    session.result()["delta"] = Json();
    delta_.check_maps(reference, other);
    const DiffReport report = compare(session, reference, other);
    if (delta_.given()) delta_.write(session, reference, other, heavy_);
    report_difference(session, report);
  }

 private:
  void check_blame() {
    const std::pair<const char*, bool> given[] = {
        {"--level", level_.has_value()},      {"--tolerance", tolerance_.has_value()},
        {"--top", top_text_.has_value()},     {"--layer or --bbox", filter_.any()},
        {"--png", picture_path_.has_value()}, {"--delta", delta_.given()}};
    for (const auto& [name, is_given] : given) {
      if (is_given) throw usage_error(fmt::format("{} does not go with --blame", name));
    }
    heavy_.check();
    blame_.check(inputs_);
  }

  void check_level() {
    if (level_) {
      const std::string name = parse_choice("--level", *level_, {"bytes", "cells", "belief"});
      options_.level = name == "bytes"   ? DiffLevel::kBytes
                       : name == "cells" ? DiffLevel::kCells
                                         : DiffLevel::kBelief;
    }
    const bool belief = options_.level == DiffLevel::kBelief;
    if (tolerance_ && !belief) throw usage_error("--tolerance goes with --level belief");
    if (belief) options_.tolerance = kDefaultTolerance;
    if (tolerance_) options_.tolerance = parse_real("--tolerance", *tolerance_, 0, 1e9);
    if (options_.level == DiffLevel::kBytes && (top_text_ || picture_path_)) {
      throw usage_error(
          fmt::format("{} needs cells, which --level bytes does not read", top_text_ ? "--top" : "--png"));
    }
  }

  void describe_inputs(Session& session, const Reader& reference, const Reader& other) const {
    Json& result = session.result();
    const Reader* readers[] = {&reference, &other};
    const char* keys[] = {"reference", "other"};
    for (std::size_t i = 0; i < 2; ++i) {
      step_opened(session, inputs_[i], *readers[i]);
      result[keys[i]] = {{"path", inputs_[i]},
                         {"content_id", readers[i]->content_id()},
                         {"patches", readers[i]->summary().patches}};
    }
  }

  /// Compares the maps and draws the picture on the way.
  DiffReport compare(Session& session, const Reader& reference, const Reader& other) {
    const DiffInput a{&reference, inputs_[0]}, b{&other, inputs_[1]};
    session.result()["png"] = Json();
    const LayerType* drawn = picture_path_ ? layer_to_draw(reference, other) : nullptr;
    if (!picture_path_) return diff(a, b, options_, session.run_options(heavy_, "comparing"));
    OutputFile file(*picture_path_, {overwrite_, false});
    DiffPicture picture(drawn != nullptr ? *drawn : LayerType::occupancy());
    if (drawn != nullptr) {
      options_.cells = &picture;
      options_.cells_layer = drawn->name;
    }
    const std::uint64_t bytes = drawn != nullptr ? DiffPicture::most_bytes(reference, other, drawn->name) : 0;
    DiffReport report = work_beside_picture(bytes, session.run_options(heavy_, "comparing"),
                                            [&](const RunOptions& run) { return diff(a, b, options_, run); });
    session.check_cancelled();
    draw(session, picture, drawn, reference.header().frame, file);
    return report;
  }

  /// The first that is asked for, else the first occupancy layer that holds something, else the first that
  /// does; nullptr if no map has a type.
  const LayerType* layer_to_draw(const Reader& reference, const Reader& other) const {
    const LayerType* best = nullptr;
    int best_rank = -1;
    for (const Reader* reader : {&reference, &other}) {
      const TypeTable& types = reader->header().types;
      const Summary summary = reader->summary();
      for (TypeId id = 0; id < types.size(); ++id) {
        const auto& asked = options_.layers;
        if (!asked.empty() && types[id].name != asked.front()) continue;
        const int rank = (summary.types[id].layers > 0 ? 2 : 0) + (types[id].is_occupancy() ? 1 : 0);
        const bool better = rank > best_rank || (rank == best_rank && types[id].name < best->name);
        if (!better) continue;
        best = &types[id];
        best_rank = rank;
      }
    }
    return best;
  }

  void draw(Session& session, const DiffPicture& picture, const LayerType* drawn, const Frame& frame,
            OutputFile& file) const {
    const Rendering rendering = picture.rendering(frame);
    PictureText text;
    text.title = fmt::format("{} -> {}", inputs_[0], inputs_[1]);
    if (drawn != nullptr) text.facts.push_back("layer " + drawn->name);
    if (options_.level == DiffLevel::kBelief) {
      text.facts.push_back("tolerance " + number_text(options_.tolerance));
    }
    if (!rendering.raster.empty()) text.facts.push_back(fmt::format("{:.6g} m/px", rendering.pixel_m));
    if (rendering.patch_px > 0) text.facts.push_back(fmt::format("patches of {:.6g} m", frame.edge_m()));
    text.facts.push_back("frame " + frame.frame_id);
    if (frame.epsg) text.facts.push_back(fmt::format("EPSG:{}", *frame.epsg));
    text.up = frame.epsg ? "N" : "y";
    text.no_data = "the maps hold nothing to compare";
    const Raster raster = compose(rendering, text);
    write_png(raster, file);
    session.check_cancelled();
    file.commit();
    session.result()["png"] = {{"path", *picture_path_},
                               {"layer", drawn != nullptr ? Json(drawn->name) : Json()},
                               {"area_m", rendering.raster.empty() ? Json() : box_json(rendering.area)},
                               {"pixel_m", rendering.raster.empty() ? Json() : Json(rendering.pixel_m)},
                               {"picture_px", {raster.width, raster.height}}};
    session.done(fmt::format("wrote '{}'", *picture_path_));
  }

  void report_difference(Session& session, const DiffReport& report) const {
    const bool belief = options_.level == DiffLevel::kBelief;
    session.result().update(diff_json(report, options_.level, top_));
    session.result()["level"] = to_string(options_.level);
    session.result()["tolerance"] = belief ? Json(options_.tolerance) : Json();
    session.print(fmt::format("{} -> {}: {} (level {}{})\n", inputs_[0], inputs_[1],
                              report.different ? "different" : "equal", to_string(options_.level),
                              belief ? ", tolerance " + number_text(options_.tolerance) : ""));
    session.print(diff_text(report, options_.level, top_));
    const auto patches =
        report.patches_added + report.patches_removed + report.patches_changed + report.patches_equal;
    if (options_.box && patches == 0) {
      session.warning(fmt::format("nothing of '{}' and '{}' lies in --bbox", inputs_[0], inputs_[1]));
    }
    if (report.different) session.answer_no();
  }

  std::vector<std::string> inputs_;
  std::optional<std::string> level_, tolerance_, top_text_, picture_path_;
  std::size_t top_ = 0;
  bool overwrite_ = false;
  DiffOptions options_;
  Filter filter_;
  DeltaOutput delta_;
  BlameQuestion blame_;
  HeavyOptions heavy_;
};

}  // namespace
}  // namespace apgm::tools

int main(int argc, char** argv) {
  apgm::tools::DiffTool tool;
  return apgm::tools::run_tool(tool, argc, argv);
}
