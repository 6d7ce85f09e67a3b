#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <cmath>
#include <memory>

#include "apgm/format/reader.hpp"
#include "apgm/ops/copy.hpp"
#include "converters/common/file.hpp"
#include "converters/fixed_grid/choose_layout.hpp"
#include "tools/common/app.hpp"
#include "tools/common/drive_source.hpp"
#include "tools/common/exit_code.hpp"
#include "tools/common/grid.hpp"
#include "tools/common/layout_memory.hpp"
#include "tools/common/layout_output.hpp"
#include "tools/common/options.hpp"
#include "tools/common/report.hpp"
#include "tools/common/signals.hpp"

namespace apgm::tools {
namespace {

constexpr const char* kLayoutsGroup = "Layouts";
constexpr const char* kDriveGroup = "Drives";
constexpr std::uint64_t kMaxYamlBytes = std::uint64_t{1} << 20;
constexpr double kMaxMapBytes = 2.0 * (1 << 30);
constexpr double kUsualReach_m = 100;
constexpr double kUsualEvery_s = 10;

std::string read_yaml(const std::string& path) { return converters::read_file(path, kMaxYamlBytes); }

class CompareTool final : public Tool {
 public:
  ToolInfo info() const override {
    return {
        .verb = "compare",
        .summary = "what a map or a drive costs in other layouts",
        .usage = "[OPTIONS] MAP.apgm | --profile FILE.yaml SCANS...",
        .details =
            {"Puts the cells of a map into the layouts of the literature (docs/layouts.md): non-uniform "
             "moving "
             "grids (Buerkle et al. 2020; presets A, B, C and --layout), sub-maps of one cell size in five "
             "containers (Wellhausen et al. 2021), and the dense moving grid. Sub-maps and the moving grid "
             "have "
             "the finest cells that are present, or that the profile asks for. All store every layer in each "
             "cell. Ratios are to the map itself.",
             "With --profile the inputs are recordings as apgm-map reads them: a live map follows the "
             "vehicle "
             "and the requirements. Layouts that move travel with it: they shift after each scan, what "
             "enters "
             "is filled from the map, and what the map dropped stays until it leaves. Every --every seconds "
             "the map's cells are brought in again and all is measured; with --cost the times of these "
             "shifts, "
             "too.",
             "OctoMap, GeoTIFF (ZSTD, a file a layer) and NumPy (.npz) are written to a temporary directory "
             "and "
             "read back. An octree counts its leaves, and what OcTree::memoryUsage says.",
             "Tables show cells, the share that holds data, bytes of values, all bytes that are allocated, "
             "bytes "
             "of a file, and how belief changes: each cell of the map as it comes back from the layout. Lost "
             "cells lie outside of it or are not stored. Lost obstacles had BetP(O) above 0.5. What is not "
             "measured is '-'.",
             "--csv writes a row for each moment and layout; the columns stand in docs/evaluation.md."},
        .examples = {{"apgm-compare site.apgm --at 12.5,-3", "the vehicle stands there"},
                     {"apgm-compare site.apgm --layout plan.yaml --cost", "a plan of yours; times too"},
                     {"apgm-compare run.clf.bz2 --profile drive.yaml --csv run.csv --plot run.svg",
                      "a drive, with table and picture"}},
        .exit_codes = {{kExitOutput, "an output exists, is not permitted, or the disk is full"},
                       {kExitLimit, "the map or a layout is too large"},
                       {kExitIncompatible, "the map is empty, or the poses do not fit the clouds"}}};
  }

  void add_options(CLI::App& app) override {
    add_text(app, kLayoutsGroup, "--at", at_, "X,Y",
             "where the vehicle is, in metres of the map's CRS (default: the middle of the map)");
    add_list(app, kLayoutsGroup, "--layout", layouts_, "FILE.yaml",
             "compare with this non-uniform grid too (docs/layouts.md)");
    add_text(app, kLayoutsGroup, "--reach", reach_, "M",
             "half extent of the moving grid (default: the largest horizon of the profile, else 100)");
    add_switch(app, kLayoutsGroup, "--cost", options_.cost,
               "measure the time of accesses: differs from run to run");
    add_text(app, kDriveGroup, "--profile", profile_, "FILE.yaml",
             "inputs are a drive; requirements round the vehicle, by seconds since the first scan");
    add_text(app, kDriveGroup, "--every", every_, "S",
             "compare at most once in so many seconds (default 10); 0: after each scan");
    add_text(app, kDriveGroup, "--poses", poses_, "FILE", "poses of clouds, as for apgm-map");
    add_text(app, kDriveGroup, "--models", models_file_, "FILE.yaml", "parameters of the sensor models");
    add_text(app, kDriveGroup, "--heights", heights_, "ZMIN,ZMAX",
             "heights of the map in metres that count as obstacles, ZMAX left out (default: all)");
    add_text(app, kDriveGroup, "--edge", edge_, "M", "side of a patch in metres (default 12.8)");
    add_switch(
        app, kDriveGroup, "--motion", motion_,
        "the input is a file of poses (KITTI, TUM): all that the profile asks for is taken as seen; no "
        "files, no beliefs: all cells are alike");
    add_text(app, "Output", "--csv", csv_, "FILE.csv", "write a table");
    add_text(app, "Output", "--plot", plot_, "FILE.svg", "draw bytes by layout, or over time");
    add_switch(app, "Output", "-O,--overwrite", overwrite_, "replace existing files");
    heavy_.add(app);
  }

  void check(Session& session, const std::vector<std::string>& inputs) override {
    check_inputs(inputs);
    inputs_ = inputs;
    if (at_) vehicle_ = parse_point("--at", *at_, kMaxCoordinate_m);
    if (reach_) options_.reach_m = parse_real("--reach", *reach_, 1e-2, 1e4);
    check_drive();
    std::vector<std::string> read = inputs;
    for (const auto& path : {poses_, profile_, models_file_}) {
      if (path) read.push_back(*path);
    }
    read.insert(read.end(), layouts_.begin(), layouts_.end());
    outputs_.check(csv_, plot_, overwrite_, read);
    if (plot_) warn_of_extension(session, *plot_, ".svg");
    heavy_.check();
    options_.disk = options_.change = !motion_;
    options_.plans = usual_plans();
    for (const std::string& path : layouts_) {
      options_.plans.push_back(converters::naming(path, [&] { return parse_plan(read_yaml(path), path); }));
    }
  }

  void run(Session& session) override {
    LayoutOutput output(outputs_);
    if (profile_) {
      drive(session, output);
    } else {
      one_map(session, output);
    }
    session.check_cancelled();
    output.finish(title());
  }

 private:
  std::string title() const {
    const std::string name = inputs_.front() == "-" ? "standard input" : inputs_.front();
    return name.substr(name.rfind('/') + 1) + ": bytes by layout";
  }

  void check_drive() {
    if (!profile_) {
      one_input(inputs_);
      for (const auto& [name, given] :
           {std::pair{"--every", every_.has_value()}, std::pair{"--poses", poses_.has_value()},
            std::pair{"--models", models_file_.has_value()}, std::pair{"--heights", heights_.has_value()},
            std::pair{"--edge", edge_.has_value()}, std::pair{"--motion", motion_}}) {
        if (given) throw usage_error(fmt::format("{} is for drives", name), "name a --profile");
      }
      return;
    }
    if (at_) throw usage_error("--at is for maps: in a drive the vehicle is where the poses say");
    if (motion_) one_input(inputs_);
    if (motion_ && poses_) throw usage_error("--motion and --poses exclude each other");
    if (every_) every_s_ = parse_real("--every", *every_, 0, 1e6);
    if (edge_) request_.frame.edge_um = whole_micrometres("--edge", parse_real("--edge", *edge_, 1e-3, 1e4));
    request_.frame.check();
    if (models_file_) request_.models = parse_models(read_yaml(*models_file_), *models_file_);
    if (heights_) {
      const Point z = parse_point("--heights", *heights_, 1e4);
      if (!(z.x_m < z.y_m)) throw usage_error("--heights takes ZMIN,ZMAX with ZMIN < ZMAX");
      request_.models.limits.z_min_m = z.x_m;
      request_.models.limits.z_max_m = z.y_m;
    }
    request_.models.check();
    request_.schedule = parse_profiles(read_yaml(*profile_), *profile_);
    converters::naming(*profile_, [&] { request_.check(); });
    options_.finest_cell_m = finest_cell_m(request_.schedule, request_.frame);
    if (!reach_) options_.reach_m = farthest_m(request_.schedule).value_or(kUsualReach_m);
  }

  void one_map(Session& session, LayoutOutput& output) {
    const Reader source(inputs_.front());
    if (source.summary().patches == 0) {
      throw Error(ErrorCode::kIncompatible, fmt::format("'{}' holds no patches to compare", inputs_.front()))
          .hint("'apgm-info' tells what is in a map")
          .at(inputs_.front());
    }
    step_opened(session, inputs_.front(), source);
    if (!vehicle_) vehicle_ = converters::middle_of(source);
    if (!reach_) options_.reach_m = kUsualReach_m;
    options_.finest_cell_m = converters::finest_cell_m(source);
    const Map map = read(session, source);
    const LayoutsAt at{0, "", *vehicle_, compare_layouts(map, *vehicle_, options_)};
    LayoutMeans means;
    means.add(at);
    output.add(at);
    session.print(means.text());
    Json& result = session.result();
    result["vehicle_m"] = {vehicle_->x_m, vehicle_->y_m};
    result["finest_cell_m"] = options_.finest_cell_m;
    result["layouts"] = means.json();
  }

  Map read(Session& session, const Reader& source) {
    if (heavy_.max_memory_bytes == 0 && map_bytes(source) > kMaxMapBytes) {
      throw Error(ErrorCode::kLimit, fmt::format("'{}' is too large to compare at once", inputs_.front()))
          .hint("cut a part out with apgm-crop, or name a bound with --max-memory");
    }
    bound_memory(session);
    check_memory(source, options_);
    Map map(source.header());
    MapSink sink(map);
    options_.run = session.run_options(heavy_, "reading");
    copy(source, map.header().types, sink, true, options_.run);
    return map;
  }

  void bound_memory(Session& session) {
    if (heavy_.max_memory_bytes == 0) return;
    options_.memory_left = [this, &session] { return session.memory_left(heavy_); };
  }

  void drive(Session& session, LayoutOutput& output) {
    request_.scans.paths = inputs_;
    request_.scans.cancel = &cancel_flag();
    if (poses_) request_.scans.poses = *poses_;
    bound_memory(session);
    request_.memory_left = options_.memory_left;
    const std::unique_ptr<DriveSource> source = motion_ ? open_motion(request_) : open_drive(request_);
    options_.run = session.run_options(heavy_, "comparing", ProgressUnit::kBytes);
    std::optional<LayoutComparison> layouts;
    DriveMeans means;
    DriveMoment moment;
    double next_s = 0;
    while (source->next(moment)) {
      session.check_cancelled();
      if (options_.run.progress) options_.run.progress(source->bytes_done(), source->total_bytes());
      if (!layouts) layouts.emplace(source->map(), options_);
      // All that --motion sees is the same: what enters is filled when it is looked at.
      layouts->move_to(moment.vehicle, motion_ ? nullptr : &source->map());
      if (moment.time_s < next_s - 1e-9) continue;
      next_s = every_s_ > 0 ? (std::floor(moment.time_s / every_s_ + 1e-9) + 1) * every_s_ : 0;
      const LayoutsAt at{moment.time_s, moment.profile, moment.vehicle, layouts->rows(source->map())};
      means.add(at);
      output.add(at);
    }
    for (const std::string& fault : source->faults()) session.warning("left out: " + fault);
    session.print(means.text());
    Json& result = session.result();
    result["finest_cell_m"] = options_.finest_cell_m;
    result["measurements"] = source->measurements();
    result["phases"] = means.json();
  }

  std::optional<std::string> at_, reach_, profile_, every_, poses_, models_file_, heights_, edge_, csv_,
      plot_;
  std::vector<std::string> layouts_, inputs_;
  bool motion_ = false, overwrite_ = false;
  std::optional<Point> vehicle_;
  double every_s_ = kUsualEvery_s;
  DriveRequest request_;
  CompareOptions options_;
  LayoutFiles outputs_;
  HeavyOptions heavy_;
};

}  // namespace
}  // namespace apgm::tools

int main(int argc, char** argv) {
  apgm::tools::CompareTool tool;
  return apgm::tools::run_tool(tool, argc, argv);
}
