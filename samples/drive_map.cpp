// The drive of the paper's evaluation: a live map that follows a vehicle through a simulated town while the
// requirements change from parking to road and back.
//
// Same bytes on every machine for the same seed, profiles and models.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/format/output_file.hpp"
#include "scene/paper_drive.hpp"
#include "scene/scene.hpp"
#include "scene/write_map.hpp"
#include "support/program.hpp"
#ifdef APGM_HAS_LAYOUT_TOOLS
#include "tools/common/layout_output.hpp"
#endif

namespace {

using namespace apgm::samples;

constexpr const char* kUsage =
    "usage: drive-map [--seed N] [--from S] [--seconds N] [--profiles FILE] [--models FILE]\n"
    "                 [--stats FILE.csv] [-O] [-o OUT.apgm]\n"
    "\n"
    "Drives 465 s through a simulated town, parking until 156 s, on the road until 340 s, parking again, "
    "and\n"
    "prints what the live map held on average, phase by phase.\n"
    "\n"
    "      --seed N          of town and noise (default 1)\n"
    "      --from S          begin here, in seconds, with an empty map (default 0)\n"
    "      --seconds N       how long (default: to the end)\n"
    "      --profiles FILE   requirements over time (default: samples/profiles/paper_drive.yaml)\n"
    "      --models FILE     measurement models (default: samples/profiles/models.yaml)\n"
    "      --stats FILE.csv  a line for each step\n"
    "      --compare F.csv   what the map costs in other layouts, as apgm-compare writes it\n"
    "      --plot FILE.svg   the same as a picture\n"
    "      --every S         seconds between such comparisons (default 10)\n"
    "      --cost            measure the times of accesses and shifts, too\n"
    "  -o, --output FILE     the live map at the end\n"
    "  -O, --overwrite       replace existing files\n";

struct Options {
  PaperDriveOptions drive;
  std::string profiles = APGM_SAMPLE_PROFILES "/paper_drive.yaml";
  std::string models = APGM_SAMPLE_PROFILES "/models.yaml";
  std::string stats, compare, plot, output;
  double every_s = 10;
  bool cost = false, overwrite = false;
};

double number(const std::string& text, const std::string& flag) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (*end != '\0' || !(value >= 0 && value <= 1e6)) {
    throw UsageError{"'" + text + "' is not a value for " + flag};
  }
  return value;
}

Options parse(std::vector<std::string>& args) {
  Options options;
  options.drive.seed = take_seed(args);
  const auto take = [&](const char* flag, auto use) {
    if (const std::string value = take_option(args, flag); !value.empty()) use(value);
  };
  take("--from", [&](const std::string& v) { options.drive.from_s = number(v, "--from"); });
  take("--seconds", [&](const std::string& v) { options.drive.seconds = number(v, "--seconds"); });
  take("--profiles", [&](const std::string& v) { options.profiles = v; });
  take("--models", [&](const std::string& v) { options.models = v; });
  take("--stats", [&](const std::string& v) { options.stats = v; });
  take("--compare", [&](const std::string& v) { options.compare = v; });
  take("--plot", [&](const std::string& v) { options.plot = v; });
  take("--every", [&](const std::string& v) { options.every_s = number(v, "--every"); });
  take("-o", [&](const std::string& v) { options.output = v; });
  take("--output", [&](const std::string& v) { options.output = v; });
  options.cost = take_switch(args, "--cost");
  const bool short_overwrite = take_switch(args, "-O");
  options.overwrite = take_switch(args, "--overwrite") || short_overwrite;
  expect_arguments(args, 0);
  return options;
}

std::string text_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (!file) throw apgm::Error(apgm::ErrorCode::kUnreadable, "cannot read '" + path + "'");
  return text;
}

template <class... Values>
std::string format(const char* pattern, Values... values) {
  char line[512];
  std::snprintf(line, sizeof line, pattern, values...);
  return line;
}

constexpr const char* kColumns =
    "time_s,profile,x_m,y_m,patches,"
    "occupancy_cells,occupancy_bytes,occupancy_fill,occupancy_observe_ms,occupancy_fuse_ms,occupancy_upkeep_"
    "ms,"
    "semantics_cells,semantics_bytes,semantics_fill,semantics_observe_ms,semantics_fuse_ms,semantics_upkeep_"
    "ms\n";

double fill(const DriveStep::OfLayer& layer) {
  return layer.cells == 0 ? 0 : static_cast<double>(layer.known) / static_cast<double>(layer.cells);
}

std::string columns_of(const DriveStep::OfLayer& layer) {
  return format(",%llu,%llu,%.4f,%.3f,%.3f,%.3f", static_cast<unsigned long long>(layer.cells),
                static_cast<unsigned long long>(layer.bytes), fill(layer), 1e3 * layer.observe_s,
                1e3 * layer.fuse_s, 1e3 * layer.upkeep_s);
}

std::string line_of(const DriveStep& step) {
  return format("%.1f,%s,%.2f,%.2f,%llu", step.time_s, step.profile.c_str(), step.vehicle.x_m,
                step.vehicle.y_m, static_cast<unsigned long long>(step.patches)) +
         columns_of(step.occupancy) + columns_of(step.semantics) + "\n";
}

/// Sums over the steps of one phase.
struct Phase {
  explicit Phase(const DriveStep& first) : name(first.profile), from_s(first.time_s) {}

  std::string name;
  double from_s, to_s = 0, steps = 0;
  double patches = 0, observe_s = 0, fuse_s = 0, upkeep_s = 0;
  struct OfLayer {
    double cells = 0, known = 0, bytes = 0;
    void add(const DriveStep::OfLayer& layer) {
      cells += static_cast<double>(layer.cells);
      known += static_cast<double>(layer.known);
      bytes += static_cast<double>(layer.bytes);
    }
  } occupancy, semantics;

  void add(const DriveStep& step) {
    to_s = step.time_s;
    steps += 1;
    patches += static_cast<double>(step.patches);
    observe_s += step.occupancy.observe_s + step.semantics.observe_s;
    fuse_s += step.occupancy.fuse_s + step.semantics.fuse_s;
    upkeep_s += step.occupancy.upkeep_s + step.semantics.upkeep_s;
    occupancy.add(step.occupancy);
    semantics.add(step.semantics);
  }
};

void print(const std::vector<Phase>& phases) {
  std::puts(
      "phase           time [s]  patches  occupancy cells  fill  semantics cells  fill   values [MB]"
      "  observe [ms]  fuse [ms]  upkeep [ms]");
  for (const Phase& p : phases) {
    const auto cells = [&](const Phase::OfLayer& layer) {
      if (layer.cells == 0) return std::string("               -     -");
      return format("%16.0f  %3.0f%%", layer.cells / p.steps, 100 * layer.known / layer.cells);
    };
    std::printf("%-12s %5.1f-%5.1f  %7.1f %s %s %13.2f %13.2f %10.2f %12.2f\n", p.name.c_str(), p.from_s,
                p.to_s, p.patches / p.steps, cells(p.occupancy).c_str(), cells(p.semantics).c_str(),
                (p.occupancy.bytes + p.semantics.bytes) / p.steps / 1e6, 1e3 * p.observe_s / p.steps,
                1e3 * p.fuse_s / p.steps, 1e3 * p.upkeep_s / p.steps);
  }
  std::puts("the paper:   parking 243000 occupancy cells; road 345000 occupancy, 88000 semantic cells");
}

#ifdef APGM_HAS_LAYOUT_TOOLS
/// The live map in other layouts, every few seconds.
class Comparison {
 public:
  Comparison(const Options& options, const apgm::Schedule& schedule, const apgm::Frame& frame)
      : period_(std::max(1L, std::lround(options.every_s * 10))), output_(files(options)) {
    what_.plans = apgm::tools::usual_plans();
    what_.finest_cell_m = apgm::tools::finest_cell_m(schedule, frame);
    what_.reach_m = apgm::tools::farthest_m(schedule).value_or(100);
    what_.disk = true;
    what_.cost = options.cost;
  }

  void add(const DriveStep& step, const apgm::Map& map) {
    if (!layouts_) layouts_.emplace(map, what_);
    layouts_->move_to(step.vehicle, &map);
    if (steps_++ % period_ != 0) return;
    const apgm::tools::LayoutsAt at{step.time_s, step.profile, step.vehicle, layouts_->rows(map)};
    means_.add(at);
    output_.add(at);
  }

  void finish() {
    output_.finish("simulated drive: bytes by layout");
    std::printf("\n%s", means_.text().c_str());
  }

 private:
  static apgm::tools::LayoutFiles files(const Options& options) {
    apgm::tools::LayoutFiles files;
    files.overwrite = options.overwrite;
    if (!options.compare.empty()) files.csv = options.compare;
    if (!options.plot.empty()) files.plot = options.plot;
    return files;
  }

  long period_, steps_ = 0;
  apgm::tools::CompareOptions what_;
  std::optional<apgm::tools::LayoutComparison> layouts_;
  apgm::tools::LayoutOutput output_;
  apgm::tools::DriveMeans means_;
};
#else
struct Comparison {
  Comparison(const Options&, const apgm::Schedule&, const apgm::Frame&) {
    throw UsageError{"this build compares no layouts: it lacks the tools"};
  }
  void add(const DriveStep&, const apgm::Map&) {}
  void finish() {}
};
#endif

void drive_map(std::vector<std::string> args) {
  const Options options = parse(args);
  const apgm::Models models = apgm::parse_models(text_of(options.models), options.models);
  const apgm::Schedule schedule = apgm::parse_profiles(text_of(options.profiles), options.profiles);
  std::unique_ptr<apgm::OutputFile> stats;
  if (!options.stats.empty()) {
    stats = std::make_unique<apgm::OutputFile>(options.stats, apgm::OutputOptions{options.overwrite});
    stats->write(kColumns);
  }
  if (!options.output.empty() && !options.overwrite) check_absent(options.output);
  std::unique_ptr<Comparison> comparison;
  if (!options.compare.empty() || !options.plot.empty()) {
    comparison = std::make_unique<Comparison>(options, schedule, sample_frame());
  }
  std::vector<Phase> phases;
  const auto on_step = [&](const DriveStep& step, const apgm::Map& map) {
    if (phases.empty() || phases.back().name != step.profile) phases.emplace_back(step);
    phases.back().add(step);
    if (stats) stats->write(line_of(step));
    if (comparison) comparison->add(step, map);
  };
  const apgm::Map map = run_paper_drive(options.drive, models, schedule, on_step);
  if (stats) stats->flush();
  if (!options.output.empty()) write_map(map, options.output, options.overwrite);
  if (stats) stats->commit();
  print(phases);
  if (comparison) comparison->finish();
}

}  // namespace

int main(int argc, char** argv) { return run_program("drive-map", kUsage, argc, argv, drive_map); }
