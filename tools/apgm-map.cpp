#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <chrono>
#include <limits>

#include "apgm/core/budget.hpp"
#include "apgm/format/scratch_map.hpp"
#include "apgm/format/writer.hpp"
#include "apgm/observe/mapper.hpp"
#include "apgm/ops/copy.hpp"
#include "converters/common/file.hpp"
#include "converters/scans/scan_reader.hpp"
#include "tools/common/app.hpp"
#include "tools/common/exit_code.hpp"
#include "tools/common/grid.hpp"
#include "tools/common/observe_json.hpp"
#include "tools/common/options.hpp"
#include "tools/common/report.hpp"
#include "tools/common/scan_mapping.hpp"
#include "tools/common/scan_memory.hpp"
#include "tools/common/scan_stats.hpp"
#include "tools/common/scratch.hpp"
#include "tools/common/signals.hpp"

namespace apgm::tools {
namespace {

using converters::Measurement;
using converters::ScanReader;

constexpr const char* kScansGroup = "Scans";
constexpr const char* kMapGroup = "Map";
constexpr const char* kModelGroup = "Sensor model";

constexpr std::uint64_t kMaxYamlBytes = std::uint64_t{1} << 20;
/// Values of layers that stay in memory unless --max-memory says otherwise.
constexpr std::uint64_t kUsualLayerBytes = std::uint64_t{1} << 30;
/// Layers of the largest kind that every budget has room for in one scan.
constexpr std::uint64_t kLeastScanLayers = 6;

std::string read_yaml(const std::string& path) { return converters::read_file(path, kMaxYamlBytes); }

double seconds(std::chrono::steady_clock::duration d) { return std::chrono::duration<double>(d).count(); }

/// How --max-memory is shared out: a quarter to the layers in memory, of which a Mapper keeps an eighth again
/// for those to come; a sixteenth to the list of what rests; and what is left to the cells of one scan, and
/// to the work with the layer in hand.
struct Shares {
  static constexpr std::uint64_t kParts = 32, kLayers = 8, kSpares = 1, kList = 2;
  static constexpr std::uint64_t kScan = kParts - kLayers - kSpares - kList;
  /// What a layer takes beside its values, in memory and at rest.
  static constexpr std::uint64_t kLayerOverhead = 512, kListedLayer = 320;
  /// A short list is part of what is kept for buffers.
  static constexpr std::uint64_t kShortList = std::uint64_t{2} << 20;

  std::uint64_t work_bytes = 0;         ///< with the layer in hand, whatever the budget
  std::uint64_t least_layer_bytes = 1;  ///< values of the smallest layer

  std::uint64_t layers(std::uint64_t budget) const { return values(budget / kParts * kLayers); }
  std::uint64_t scan(std::uint64_t budget) const {
    const std::uint64_t share = budget / kParts * kScan;
    return share > work_bytes ? values(share - work_bytes) : 0;
  }
  static std::uint64_t list(std::uint64_t budget) { return budget / kParts * kList + kShortList; }

  /// The least budget that leaves so much.
  std::uint64_t budget_for_layers(double values) const { return budget_for(values * per_value(), kLayers); }
  std::uint64_t budget_for_scan(double values) const {
    return budget_for(values * per_value() + static_cast<double>(work_bytes), kScan);
  }
  static std::uint64_t budget_for_list(double bytes) { return budget_for(bytes, kList); }

 private:
  double per_value() const { return 1 + double{kLayerOverhead} / static_cast<double>(least_layer_bytes); }
  std::uint64_t values(std::uint64_t bytes) const {
    return static_cast<std::uint64_t>(static_cast<double>(bytes) / per_value());
  }
  static std::uint64_t budget_for(double bytes, std::uint64_t parts) {
    return static_cast<std::uint64_t>(std::min(bytes / static_cast<double>(parts) + 1, 0x1p56)) * kParts;
  }
};

/// What became of the measurements.
struct Tally {
  std::uint64_t scans = 0;  // mapped
  std::uint64_t beams = 0;
  Skipped readings;
  std::uint64_t cells_fused = 0;
  std::uint64_t total_conflicts = 0;
  std::int64_t first_ns = 0, last_ns = 0;
  double map_s = 0;

  double duration_s() const { return static_cast<double>(last_ns - first_ns) / 1e9; }
};

class MapTool final : public Tool {
 public:
  ToolInfo info() const override {
    return {
        .verb = "map",
        .summary = "make a map of laser scans and point clouds",
        .usage = "[OPTIONS] SCANS... -o OUTPUT",
        .details =
            {"Reads CARMEN logs (.log, .clf), OctoMap scan graphs (.graph), clouds (.pcd, KITTI's .bin, "
             ".csv) "
             "and directories of them, each also packed by bzip2. Logs and graphs hold their poses; those of "
             "clouds come from --poses. Lines and clouds that are cut, impossible or out of order in time "
             "are "
             "left out, counted and told at the end.",
             "Cells hold masses of occupied and free evidence, fused by Dempster's rule. The same scans and "
             "options give the same bytes, whatever --max-memory says.",
             "--stats writes a row for each scan and layer: scan (from 0), time_s since the first that is "
             "mapped, "
             "layer, patches of the whole map in memory, layers and cells and bytes of values of this layer "
             "in memory, cells_fused by this scan, and the time that took: observe_ms (rays and sensor "
             "model) and fuse_ms (with ageing and resampling)."},
        .examples =
            {{"apgm-map run.clf -o run.apgm", "cells of 0.1 m"},
             {"apgm-map run.clf.bz2 --resolution 0.05 --model richter -o run.apgm", "finer, another model"},
             {"apgm-map clouds/ --poses poses.txt --heights -0.5,1.5 -o site.apgm",
              "a directory of clouds; what stands 0.5 m below to 1.5 m above the origin of the poses"},
             {"apgm-map run.clf --profile drive.yaml --stats drive.csv -o run.apgm",
              "resolutions as the requirements round the vehicle ask for, with a table of costs"}},
        .exit_codes = {{kExitOutput, "an output exists, is not permitted, or the disk is full"},
                       {kExitLimit, "a limit of the format or the budget is met"},
                       {kExitIncompatible, "the poses do not fit the clouds"}}};
  }

  void add_options(CLI::App& app) override {
    add_text(app, kScansGroup, "--poses", poses_, "FILE",
             "poses of clouds: KITTI (12 numbers a line), TUM (time x y z qx qy qz qw), or libpointmatcher's "
             "list");
    add_text(app, kScansGroup, "--from", from_, "FORMAT",
             "format of the scans (default: by content, then by extension): " + join(format_names()));
    add_text(app, kScansGroup, "--from-scan", first_scan_, "N", "leave out the scans before scan N, from 0");
    add_text(app, kScansGroup, "--to-scan", end_scan_, "N", "leave out scan N and all after it");
    add_text(app, kMapGroup, "--resolution", resolution_, "M",
             "largest side of a cell in metres (default 0.1): --edge / 2^r is taken");
    add_text(
        app, kMapGroup, "--profile", profile_, "FILE.yaml",
        "requirements round the vehicle in place of --resolution, by seconds since the first scan that is "
        "mapped");
    add_text(app, kMapGroup, "--edge", edge_, "M", "side of a patch in metres (default 12.8)");
    add_text(app, kMapGroup, "--datum", datum_, "X,Y",
             "lower-left corner of patch (0, 0) in metres, in whole micrometres (default 0,0)");
    add_text(app, kMapGroup, "--frame-id", frame_id_, "NAME", "name of the coordinate frame (default map)");
    add_text(app, kMapGroup, "--epsg", epsg_, "CODE", "EPSG code of the coordinates (default: unknown)");
    add_text(app, kMapGroup, "--ageing", ageing_, "A",
             "share of the evidence that is left after a second, above 0 to 1 (default 1: all)");
    add_text(app, kMapGroup, "--min-unknown", min_unknown_, "M",
             "unknown mass that an observed cell keeps, 0 to 0.5 (default " +
                 number_text(MapperOptions{}.min_unknown) + ")");
    add_text(app, kModelGroup, "--model", model_, "nuss|richter",
             "free evidence only in cells without returns (default), or also in these");
    add_text(app, kModelGroup, "--models", models_file_, "FILE.yaml", "parameters of the sensor models");
    add_text(app, kModelGroup, "--heights", heights_, "ZMIN,ZMAX",
             "heights of the map in metres that count as obstacles, ZMAX left out (default: all)");
    add_text(app, "Output", "--stats", stats_, "FILE.csv", "write a table of what each scan cost");
    output_.add(app);
    writing_.add(app);
    heavy_.add(app);
  }

  void check(Session& session, const std::vector<std::string>& inputs) override {
    check_inputs(inputs);
    request_.paths = inputs;
    request_.cancel = &cancel_flag();
    check_scans();
    check_frame();
    writing_.check();
    heavy_.check();
    std::vector<std::string> read = inputs;
    for (const auto& path : {poses_, profile_, models_file_}) {
      if (path) read.push_back(*path);
    }
    output_.check(session, read);
    warn_of_extension(session, output_.path, ".apgm");
    if (stats_) check_second_output("--stats", *stats_, output_, read);
    check_models();
    check_resolution(session);
    check_memory(session);
  }

  void run(Session& session) override {
    const std::unique_ptr<ScanReader> scans = converters::open_scans(request_);
    check_not_an_input(output_.path, scans->files());
    if (stats_) check_not_an_input(*stats_, scans->files());
    if (output_.dry_run) {
      session.result()["formats"] = scans->formats();
      return report_dry_run(session, output_);
    }
    std::optional<ScanStats> stats;
    if (stats_) stats.emplace(*stats_, output_.options());
    MapHeader header;
    header.frame = frame_;
    ScratchMap scratch(header, scratch_directory(output_.path), writing_.level);
    check_memory(session);
    const Tally tally = map_scans(session, *scans, stats ? &*stats : nullptr, scratch);
    write(session, *scans, tally, stats ? &*stats : nullptr, scratch);
  }

 private:
  static std::vector<std::string> format_names() {
    std::vector<std::string> names;
    for (const converters::ScanFormat& format : converters::scan_formats()) names.emplace_back(format.name);
    return names;
  }

  void check_scans() {
    if (poses_) request_.poses = *poses_;
    if (from_) request_.format = parse_choice("--from", *from_, format_names());
    constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
    if (first_scan_) {
      from_scan_ = static_cast<std::uint64_t>(parse_integer("--from-scan", *first_scan_, 0, kMost));
    }
    if (end_scan_) to_scan_ = static_cast<std::uint64_t>(parse_integer("--to-scan", *end_scan_, 1, kMost));
    if (from_scan_ >= to_scan_) throw usage_error("--from-scan and --to-scan leave no scan");
    if (ageing_) {
      options_.ageing_per_s = parse_positive("--ageing", *ageing_);
      if (options_.ageing_per_s > 1) throw usage_error("--ageing takes a number above 0 and up to 1");
    }
    if (min_unknown_) options_.min_unknown = parse_real("--min-unknown", *min_unknown_, 0, 0.5);
  }

  void check_frame() {
    if (edge_) frame_.edge_um = whole_micrometres("--edge", parse_real("--edge", *edge_, 1e-3, 1e4));
    if (datum_) {
      const Point p = parse_point("--datum", *datum_, 1e9);
      frame_.datum_x_um = whole_micrometres("--datum", p.x_m);
      frame_.datum_y_um = whole_micrometres("--datum", p.y_m);
    }
    if (frame_id_) frame_.frame_id = *frame_id_;
    if (epsg_) frame_.epsg = static_cast<std::int32_t>(parse_integer("--epsg", *epsg_, 1, 999'999));
    frame_.check();
  }

  void check_models() {
    if (models_file_) models_ = parse_models(read_yaml(*models_file_), *models_file_);
    if (model_) {
      const bool richter = parse_choice("--model", *model_, {"nuss", "richter"}) == "richter";
      models_.kind = richter ? ModelKind::kRichter : ModelKind::kNuss;
    }
    if (heights_) {
      const Point z = parse_point("--heights", *heights_, 1e4);
      if (!(z.x_m < z.y_m)) throw usage_error("--heights takes ZMIN,ZMAX with ZMIN < ZMAX");
      models_.limits.z_min_m = z.x_m;
      models_.limits.z_max_m = z.y_m;
    }
    models_.check();
  }

  void check_resolution(Session& session) {
    if (profile_ && resolution_) throw usage_error("--profile and --resolution exclude each other");
    if (resolution_) options_.cell_m = parse_positive("--resolution", *resolution_);
    if (profile_) {
      schedule_ = parse_profiles(read_yaml(*profile_), *profile_);
      const TypeTable types({models_.occupancy_type(), models_.semantic_type()});
      try {
        for (const Schedule::Entry& entry : schedule_->entries) entry.profile.check(frame_, types);
      } catch (const Error& error) {
        throw Error(error.code(), fmt::format("'{}': {}", *profile_, error.message()))
            .hint(error.hint())
            .at(*profile_);
      }
      return;
    }
    const double cell_m = frame_.cell_m(frame_.step_for(options_.cell_m));
    if (resolution_ && cell_m < options_.cell_m * (1 - 1e-9)) {
      session.note(fmt::format("cells are {} m: the edge {} m divided by a power of two", number_text(cell_m),
                               number_text(frame_.edge_m())));
    }
  }

  /// The layers, and what a profile requires at a time.
  RequiredMemory required() const {
    const LayerType type = models_.occupancy_type();
    RequiredMemory most;
    if (!schedule_) {
      most.layer_bytes = most.least_layer_bytes = layer_memory(type, frame_.step_for(options_.cell_m));
    }
    for (std::size_t i = 0; schedule_ && i < schedule_->entries.size(); ++i) {
      const RequiredMemory own = required_memory(schedule_->entries[i].profile, frame_, type);
      if (own.layer_bytes == 0) continue;
      most.least_layer_bytes = most.layer_bytes == 0
                                   ? own.least_layer_bytes
                                   : std::min(most.least_layer_bytes, own.least_layer_bytes);
      most.layer_bytes = std::max(most.layer_bytes, own.layer_bytes);
      most.total_bytes = std::max(most.total_bytes, own.total_bytes);
    }
    return most;
  }

  Shares shares() const {
    const RequiredMemory r = required();
    const std::uint64_t in_hand = schedule_ ? 2 : 1;  // one that comes back, and what it is resampled to
    return {in_hand * r.layer_bytes + ScratchMap::working_bytes(r.layer_bytes, writing_.level),
            std::max<std::uint64_t>(1, r.least_layer_bytes)};
  }

  /// What is known to be too much for --max-memory, beside what the process holds already; before a scan is
  /// read, and again when the work starts. The rest shows on the way.
  void check_memory(Session& session) const {
    const std::uint64_t left = session.memory_left(heavy_);
    if (left == 0) return;
    const RequiredMemory r = required();
    const Shares shares = this->shares();
    const std::uint64_t writing = least_copy_memory({&r.layer_bytes, 1});
    const std::uint64_t scan = shares.budget_for_scan(static_cast<double>(kLeastScanLayers * r.layer_bytes));
    const std::uint64_t profile = schedule_ ? shares.budget_for_layers(r.total_bytes) : 0;
    // The whole need at once, so that the budget it names is enough.
    const std::uint64_t least = std::max({writing, scan, profile});
    const std::string other = "take larger cells";
    if (left < writing) {
      throw over_budget("--max-memory does not hold what it takes to write one layer", least, other);
    }
    if (left < profile) {
      throw over_budget("--max-memory does not hold the layers that the profile asks for", least, other);
    }
    if (left < scan) throw over_budget("--max-memory does not hold one scan at work", least, other);
  }

  /// What rests takes no cells, but a place in lists. What all scans will take is guessed from those so far.
  static void check_list(std::uint64_t budget, const ScratchMap& scratch, const ScanReader& scans) {
    const std::uint64_t list = scratch.layers() * Shares::kListedLayer;
    if (budget == 0 || list <= Shares::list(budget)) return;
    const double done = static_cast<double>(scans.bytes_done());
    const double whole = std::max(2.0, static_cast<double>(scans.total_bytes()) / std::max(done, 1.0));
    throw over_budget("--max-memory does not hold the list of the layers",
                      Shares::budget_for_list(static_cast<double>(list) * whole),
                      "take larger patches with --edge");
  }

  MapperOptions mapper_options(std::uint64_t budget) const {
    MapperOptions options = options_;
    options.max_memory_bytes = kUsualLayerBytes;
    if (budget > 0) {
      options.max_memory_bytes = std::max<std::uint64_t>(1, shares().layers(budget));
      options.max_measurement_bytes = std::max<std::uint64_t>(1, shares().scan(budget));
    }
    return options;
  }

  Tally map_scans(Session& session, ScanReader& scans, ScanStats* stats, ScratchMap& scratch) {
    const auto start = std::chrono::steady_clock::now();
    const std::uint64_t budget = session.memory_left(heavy_);
    Mapper mapper(frame_, models_, mapper_options(budget), &scratch);
    const RunOptions run = session.run_options(heavy_, "mapping", ProgressUnit::kBytes);
    Tally tally;
    Measurement measurement;
    std::uint64_t scan = 0;
    for (; scan < to_scan_ && scans.next(measurement); ++scan) {
      session.check_cancelled();
      if (run.progress) run.progress(scans.bytes_done(), scans.total_bytes());
      if (scan >= from_scan_) map_one(mapper, measurement, scan, stats, tally);
      check_list(budget, scratch, scans);
    }
    if (tally.scans == 0) {
      throw usage_error(fmt::format("--from-scan {} leaves no scan: there are {}", from_scan_, scan));
    }
    session.check_cancelled();
    mapper.flush();
    scratch.set_header(mapper.map().header());
    tally.readings += mapper.skipped();
    tally.map_s = seconds(std::chrono::steady_clock::now() - start);
    return tally;
  }

  void map_one(Mapper& mapper, const Measurement& m, std::uint64_t scan, ScanStats* stats, Tally& tally) {
    const std::int64_t stamp_ns = stamp_of(m);
    if (tally.scans++ == 0) tally.first_ns = tally.last_ns = stamp_ns;
    tally.last_ns = std::max(tally.last_ns, stamp_ns);
    MapperReport moved;
    if (schedule_) {
      const Profile& wanted = schedule_->at(tally.duration_s());
      if (&wanted != profile_now_) mapper.set_profile(wanted);
      profile_now_ = &wanted;
      moved = mapper.move_to(position_of(m), stamp_ns);
    }
    const MapperReport added = add(mapper, m, tally);
    for (const MapperReport::OfType& type : added.types) tally.cells_fused += type.cells_fused;
    tally.total_conflicts += added.total_conflicts;
    if (stats != nullptr) {
      stats->add(scan, tally.duration_s(), mapper.map().header().types, moved, added);
    }
  }

  /// A scan that needs more than its share tells the budget that is enough for it.
  MapperReport add(Mapper& mapper, const Measurement& m, Tally& tally) const {
    try {
      return add_measurement(mapper, m, models_.limits, tally.readings, tally.beams);
    } catch (const Error& error) {
      const auto hint = budget_hint(error);
      if (!hint) throw;
      throw over_budget(error.message(),
                        shares().budget_for_scan(static_cast<double>(hint->least_mebibytes << 20)),
                        "take larger cells or a shorter max_range_m");
    }
  }

  void write(Session& session, const ScanReader& scans, const Tally& tally, ScanStats* stats,
             ScratchMap& scratch) {
    MapHeader header = scratch.header();
    header.types = used_types(scratch);
    writing_.apply(header, Provenance{"map", scans.formats(), parameters_text(parameters(tally))});
    Writer writer(output_.path, header, writing_.options(output_));
    copy(scratch, header.types, writer, writing_.lossy != Lossy::kNone,
         session.run_options(heavy_, "writing"));
    session.check_cancelled();
    if (stats != nullptr) stats->flush();
    writer.finish();
    if (stats != nullptr) stats->commit();
    tell(session, scans, tally);
    report_written(session, output_, writer.report());
  }

  /// Types without any layer are not written.
  static TypeTable used_types(const ScratchMap& scratch) {
    const Summary summary = scratch.summary();
    std::vector<LayerType> used;
    for (std::size_t t = 0; t < summary.types.size(); ++t) {
      if (summary.types[t].layers > 0) used.push_back(scratch.header().types[static_cast<TypeId>(t)]);
    }
    return TypeTable(used);
  }

  Json parameters(const Tally& tally) const {
    Json json = models_json(models_);
    json["scans"] = tally.scans;
    json["min_unknown"] = options_.min_unknown;
    json["ageing_per_s"] = options_.ageing_per_s;
    if (first_scan_ || end_scan_) json["from_scan"] = from_scan_;
    if (schedule_) {
      json["profiles"] = schedule_json(*schedule_);
    } else {
      json["resolution_m"] = frame_.cell_m(frame_.step_for(options_.cell_m));
    }
    return json;
  }

  void tell(Session& session, const ScanReader& scans, const Tally& tally) const {
    for (const converters::ScanFault& fault : scans.faults()) session.warning("left out: " + fault.text);
    if (tally.readings.not_a_number > 0) {
      session.warning(fmt::format("{} left out that are no number",
                                  plural(tally.readings.not_a_number, "reading", "readings")));
    }
    const auto& formats = scans.formats();
    const bool clouds = std::ranges::any_of(formats, [](const auto& f) { return f != "carmen"; });
    if (clouds && !heights_ && models_.limits.z_min_m == RangeLimits{}.z_min_m) {
      session.warning("returns from all heights count as obstacles, those from the ground too");
    }
    Json faults = Json::array();
    for (const converters::ScanFault& f : scans.faults()) {
      faults.push_back({{"name", f.key}, {"count", f.count}, {"first", f.first}});
    }
    const double speed = tally.map_s > 0 ? tally.duration_s() / tally.map_s : 0;
    Json& result = session.result();
    result["scans"] = tally.scans;
    result["beams"] = tally.beams;
    result["formats"] = formats;
    result["faults"] = faults;
    result["readings_skipped"] = {{"not_a_number", tally.readings.not_a_number},
                                  {"too_near", tally.readings.too_near},
                                  {"no_return", tally.readings.no_return},
                                  {"outside", tally.readings.outside}};
    result["cells_fused"] = tally.cells_fused;
    result["total_conflicts"] = tally.total_conflicts;
    result["duration_s"] = tally.duration_s();
    result["mapping_s"] = tally.map_s;
    result["times_real_time"] = speed;
    session.step(
        fmt::format("{} with {} beams; readings left out: {} without return, {} too near, {} no "
                    "number, {} out of the map",
                    plural(tally.scans, "scan", "scans"), count_text(tally.beams),
                    count_text(tally.readings.no_return), count_text(tally.readings.too_near),
                    count_text(tally.readings.not_a_number), count_text(tally.readings.outside)));
    session.step(
        fmt::format("{} cells fused, {} of them in total conflict; {:.1f} s of recording in {:.2f} s: "
                    "{:.0f} x real time",
                    count_text(tally.cells_fused), count_text(tally.total_conflicts), tally.duration_s(),
                    tally.map_s, speed));
  }

  std::optional<std::string> poses_, from_, first_scan_, end_scan_, resolution_, profile_, edge_, datum_,
      frame_id_, epsg_, ageing_, min_unknown_, model_, models_file_, heights_, stats_;
  converters::ScanRequest request_;
  std::uint64_t from_scan_ = 0, to_scan_ = std::numeric_limits<std::uint64_t>::max();
  Frame frame_;
  Models models_;
  MapperOptions options_;
  std::optional<Schedule> schedule_;
  const Profile* profile_now_ = nullptr;
  OutputChoice output_;
  MapWriting writing_;
  HeavyOptions heavy_;
};

}  // namespace
}  // namespace apgm::tools

int main(int argc, char** argv) {
  apgm::tools::MapTool tool;
  return apgm::tools::run_tool(tool, argc, argv);
}
