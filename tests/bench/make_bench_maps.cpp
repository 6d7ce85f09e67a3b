// Writes a large town as an .apgm map and, on request, the same occupancy as an OctoMap tree.

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/format/writer.hpp"
#include "apgm/ops/copy.hpp"
#include "city.hpp"
#include "samples/support/program.hpp"
#ifdef APGM_HAVE_OCTOMAP
#include <octomap/OcTree.h>
#endif

namespace {

using namespace apgm;
using samples::UsageError;

constexpr const char* kUsage =
    "usage: make-bench-maps [--cells N] [--seed S] [--model continuous|stepped] [--overlap F] [-O]\n"
    "                       [--ot FILE.ot] -o FILE.apgm\n"
    "\n"
    "  --cells N       known cells, e.g. 10e6 (default 1e6)\n"
    "  --seed S        of masses and gaps; the town itself is always the same (default 1)\n"
    "  --model NAME    continuous: noise in all mantissa bits (default); stepped: few distinct values\n"
    "  --overlap F     share of the width that lies over the map made without this option, in [0, 1]\n"
    "  --ot FILE       the same occupancy as an OctoMap tree, one layer of 0.1 m voxels\n"
    "  -O              replace existing files\n"
    "  -j N            threads, 0: all cores (default)\n";

double number(const std::string& text, double low, double high, const std::string& flag) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !(value >= low && value <= high)) {
    throw UsageError{"'" + text + "' is not a value for " + flag};
  }
  return value;
}

bench::CityOptions city_options(std::vector<std::string>& args) {
  bench::CityOptions options;
  if (const auto v = samples::take_option(args, "--cells"); !v.empty()) {
    options.known_cells = static_cast<std::uint64_t>(number(v, 1, 5e9, "--cells"));
  }
  if (const auto v = samples::take_option(args, "--seed"); !v.empty()) {
    options.seed = static_cast<std::uint64_t>(number(v, 0, 1e9, "--seed"));
  }
  if (const auto v = samples::take_option(args, "--overlap"); !v.empty()) {
    options.overlap = number(v, 0, 1, "--overlap");
  }
  if (const auto v = samples::take_option(args, "--model"); !v.empty()) {
    if (v != "continuous" && v != "stepped") throw UsageError{"'" + v + "' is not a value for --model"};
    options.model = v == "stepped" ? bench::Model::kStepped : bench::Model::kContinuous;
  }
  return options;
}

#ifdef APGM_HAVE_OCTOMAP
void write_octree(const PatchSource& city, const std::string& path, bool overwrite) {
  if (!overwrite && std::filesystem::exists(path)) {
    throw Error(ErrorCode::kOutput, "output '" + path + "' already exists").hint("pass -O to replace it");
  }
  constexpr std::int64_t kCentre = 32768;  // OctoMap's key of coordinate 0
  octomap::OcTree tree(0.1);
  const std::int64_t side = std::int64_t{1} << bench::City::kStep;
  PatchInfo patch;
  Layer layer;
  for (const auto cursor = city.patches(); cursor->next(patch);) {
    city.load(patch.layers[0], layer);
    for (std::size_t k = 0; k < layer.cells(); ++k) {
      const double occupied = static_cast<double>(layer.plane(0)[k]);
      const double free = static_cast<double>(layer.plane(1)[k]);
      if (occupied == 0 && free == 0) continue;
      const std::int64_t i = kCentre + patch.patch.x * side + static_cast<std::int64_t>(k) % side;
      const std::int64_t j = kCentre + patch.patch.y * side + static_cast<std::int64_t>(k) / side;
      if (i < 0 || j < 0 || i > 65535 || j > 65535) {
        throw Error(ErrorCode::kLimit, "the town is larger than an octree of 0.1 m");
      }
      const octomap::OcTreeKey key(static_cast<octomap::key_type>(i), static_cast<octomap::key_type>(j),
                                   kCentre);
      const double p = 0.5 * (1 + occupied - free);  // BetP(O)
      tree.setNodeValue(key, octomap::logodds(p), /*lazy_eval=*/true);
    }
  }
  tree.updateInnerOccupancy();
  if (!tree.write(path)) throw Error(ErrorCode::kOutput, "cannot write '" + path + "'");
}
#else
void write_octree(const PatchSource&, const std::string&, bool) {
  throw Error(ErrorCode::kInvalidArgument, "this build has no OctoMap").hint("install liboctomap-dev");
}
#endif

void make_maps(std::vector<std::string> args) {
  const bench::CityOptions options = city_options(args);
  const std::string output = samples::take_option(args, "-o");
  const std::string octree = samples::take_option(args, "--ot");
  const std::string threads = samples::take_option(args, "-j");
  WriterOptions writing;
  writing.output.overwrite = samples::take_switch(args, "-O");
  samples::expect_arguments(args, 0);
  if (output.empty()) throw UsageError{"no output: pass -o FILE.apgm"};

  const bench::City city(options);
  RunOptions run;
  run.threads = threads.empty() ? 0 : static_cast<int>(number(threads, 0, 1024, "-j"));
  Writer writer(output, city.header(), writing);
  copy(city, city.header().types, writer, /*reencode=*/false, run);
  writer.finish();
  std::printf("known_cells %llu patches %llu bytes %llu\n",
              static_cast<unsigned long long>(options.known_cells),
              static_cast<unsigned long long>(writer.report().patches),
              static_cast<unsigned long long>(writer.report().file_bytes));
  if (!octree.empty()) write_octree(city, octree, writing.output.overwrite);
}

}  // namespace

int main(int argc, char** argv) {
  return samples::run_program("make-bench-maps", kUsage, argc, argv, make_maps);
}
