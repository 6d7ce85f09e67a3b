// Fuses two maps in memory by Dempster's rule, and reads the belief at a point.
//
//   02_fuse_two_maps A.apgm B.apgm X Y
//
// For maps of any size, file to file, see apgm/ops/merge.hpp (the tool apgm-merge).

#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>

#include "apgm/core/map.hpp"
#include "apgm/format/reader.hpp"
#include "apgm/fuse/framework.hpp"
#include "apgm/ops/copy.hpp"

namespace {

/// A whole file in memory: a Reader is a source of patches, a MapSink takes them.
apgm::Map read_map(const std::string& path) {
  const apgm::Reader reader(path);
  apgm::Map map(reader.header());
  apgm::MapSink sink(map);
  apgm::copy(reader, map.header().types, sink, /*reencode=*/false);
  sink.finish();
  return map;
}

void print_cell(const char* name, const apgm::Map& map, apgm::Point p) {
  const std::optional<apgm::TypeId> occupancy = map.header().types.find("occupancy");
  // A patch is looked up first: the step (cell size) may differ from patch to patch.
  const apgm::PatchIndex patch = map.header().frame.patch_at(p);
  const apgm::Layer* layer = occupancy ? map.find(patch, *occupancy) : nullptr;
  if (layer == nullptr) {
    std::printf("%-6s  nothing known\n", name);
    return;
  }
  const auto at = map.header().frame.cell_at(p, layer->step());
  const float occupied = layer->at(0, at.cell);
  const float free = layer->at(1, at.cell);
  std::printf("%-6s  m(O) %.4f  m(F) %.4f  BetP(O) %.4f\n", name, static_cast<double>(occupied),
              static_cast<double>(free),
              0.5 * (1.0 + static_cast<double>(occupied) - static_cast<double>(free)));
}

/// The whole text as a number, or nothing.
std::optional<double> number(const char* text) {
  char* end = nullptr;
  const double value = std::strtod(text, &end);
  if (end == text || *end != '\0') return {};
  return value;
}

}  // namespace

int main(int argc, char** argv) {
  const auto x_m = argc == 5 ? number(argv[3]) : std::nullopt;
  const auto y_m = argc == 5 ? number(argv[4]) : std::nullopt;
  if (!x_m || !y_m) {
    std::fputs("usage: 02_fuse_two_maps A.apgm B.apgm X Y   (X Y: metres of the maps' CRS)\n", stderr);
    return 2;
  }
  try {
    const apgm::Map a = read_map(argv[1]);
    const apgm::Map b = read_map(argv[2]);
    const apgm::Map* const both[] = {&a, &b};
    // Union of patches, union of layer types; layers of unequal cell sizes meet at the finest present.
    const apgm::Map fused = apgm::fuse_maps(both);
    std::printf("patches %zu + %zu -> %zu\n", a.size(), b.size(), fused.size());
    print_cell("a", a, {*x_m, *y_m});
    print_cell("b", b, {*x_m, *y_m});
    print_cell("fused", fused, {*x_m, *y_m});
    return 0;
  } catch (const apgm::Error& e) {
    std::fprintf(stderr, "02_fuse_two_maps: error: %s\n", e.what());
    switch (e.code()) {
      case apgm::ErrorCode::kInvalidArgument:
      case apgm::ErrorCode::kLimit:
        return 2;  // the point
      case apgm::ErrorCode::kIncompatible:
        return 7;
      default:
        return 4;
    }
  }
}
