// Counts the occupied cells of a map of any size, patch by patch: memory holds one layer at a time.
//
//   03_stream_a_file MAP.apgm

#include <cstdint>
#include <cstdio>

#include "apgm/core/error.hpp"
#include "apgm/format/reader.hpp"

namespace {

/// Cells with BetP(O) > 0.5, that is m(O) > m(F).
std::uint64_t count_occupied(const apgm::Layer& layer) {
  const auto occupied = layer.plane(0);
  const auto free = layer.plane(1);
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < layer.cells(); ++i) count += occupied[i] > free[i];
  return count;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: 03_stream_a_file MAP.apgm\n", stderr);
    return 2;
  }
  try {
    const apgm::Reader reader(argv[1]);  // reads head and tail, no layer
    const apgm::Frame& frame = reader.header().frame;
    apgm::PatchInfo patch;
    apgm::Layer layer;  // reused: no allocation after the first patch
    std::uint64_t cells = 0;
    double area_m2 = 0;
    // The cursor walks the index along a space-filling curve; pass a PatchRange to see a part of the map
    // only.
    for (const auto cursor = reader.patches(); cursor->next(patch);) {
      for (const apgm::LayerInfo& info : patch.layers) {
        if (!reader.header().types[info.type].is_occupancy()) continue;
        reader.load(info, layer);  // checks, decompresses
        const std::uint64_t occupied = count_occupied(layer);
        cells += occupied;
        area_m2 += static_cast<double>(occupied) * frame.cell_m(layer.step()) * frame.cell_m(layer.step());
      }
    }
    std::printf("%s: %llu occupied cells, %.1f m2\n", argv[1], static_cast<unsigned long long>(cells),
                area_m2);
    return 0;
  } catch (const apgm::Error& e) {
    std::fprintf(stderr, "03_stream_a_file: error: %s\n", e.what());
    return 4;
  }
}
