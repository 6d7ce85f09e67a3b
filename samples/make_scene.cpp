// Makes the maps two vehicles draw of a parking lot and the road beside it, and the exact map.
//
// Same bytes on every machine for the same seed.

#include <cstdint>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include "apgm/core/error.hpp"
#include "scene/lot.hpp"
#include "scene/lot_maps.hpp"
#include "scene/write_map.hpp"
#include "support/program.hpp"

namespace {

using namespace apgm::samples;

constexpr const char* kUsage =
    "usage: make-scene [-O] [--seed N] -o DIR\n"
    "\n"
    "Simulates two vehicles with two lidars and a camera each and writes to DIR:\n"
    "  vehicle_a.apgm vehicle_b.apgm                   occupancy and semantics, fused over the drive\n"
    "  lidar_a_front.apgm lidar_a_rear.apgm (and b)    occupancy of one sensor, fused over the drive\n"
    "  scan_a_front.apgm (and b)                       a single scan, resampling policy 'exclusive'\n"
    "  truth.apgm                                      the exact scene\n"
    "\n"
    "  -o, --output DIR   made if absent\n"
    "  -O, --overwrite    replace existing files\n"
    "      --seed N       of parked cars and noise (default 1)\n";

void make_directory(const std::string& path) {
  std::error_code failed;
  std::filesystem::create_directories(path, failed);
  if (!failed && std::filesystem::is_directory(path)) return;
  throw apgm::Error(apgm::ErrorCode::kOutput, "cannot make the directory '" + path + "'");
}

void make_scene(std::vector<std::string> args) {
  std::string dir = take_option(args, "-o");
  if (dir.empty()) dir = take_option(args, "--output");
  const std::uint64_t seed = take_seed(args);
  const bool short_overwrite = take_switch(args, "-O");
  const bool overwrite = take_switch(args, "--overwrite") || short_overwrite;
  expect_arguments(args, 0);
  if (dir.empty()) throw UsageError{"no output directory: pass -o DIR"};

  const auto names_of = [](const std::string& v) {
    return std::vector<std::string>{"vehicle_" + v + ".apgm", "lidar_" + v + "_front.apgm",
                                    "lidar_" + v + "_rear.apgm", "scan_" + v + "_front.apgm"};
  };
  if (!overwrite) {
    check_absent(dir + "/truth.apgm");
    for (const char* v : {"a", "b"}) {
      for (const auto& name : names_of(v)) check_absent(dir + "/" + name);
    }
  }
  make_directory(dir);
  const Scene scene = lot_scene(seed);
  write_map(truth_map(scene), dir + "/truth.apgm", overwrite);
  for (const std::string v : {"a", "b"}) {
    const DriveMaps maps =
        map_drive(scene, v == "a" ? drive_a() : drive_b(), v, seed + (v == "a" ? 101 : 202));
    const apgm::Map* const in_order[] = {&maps.vehicle, &maps.front, &maps.rear, &maps.first_scan};
    const auto names = names_of(v);
    for (std::size_t i = 0; i < names.size(); ++i) write_map(*in_order[i], dir + "/" + names[i], overwrite);
  }
}

}  // namespace

int main(int argc, char** argv) { return run_program("make-scene", kUsage, argc, argv, make_scene); }
