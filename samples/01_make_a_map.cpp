// Makes a map by hand and writes it: a frame, layer types, cells, a Writer.
//
//   01_make_a_map OUTPUT.apgm

#include <cstdio>
#include <string>

#include "apgm/core/map.hpp"
#include "apgm/format/writer.hpp"
#include "apgm/ops/copy.hpp"

namespace {

/// A wall of 10 m and the free ground before it, in 0.1 m cells.
apgm::Map make_map() {
  // The header says where the map lies and what its cells mean, before there is a single patch.
  apgm::MapHeader header;
  header.frame.datum_x_um = apgm::to_micrometres(570000.0);
  header.frame.datum_y_um = apgm::to_micrometres(5360000.0);
  header.frame.epsg = 32632;
  header.frame.frame_id = "utm";
  header.types = apgm::TypeTable({apgm::LayerType::occupancy()});
  header.metadata["made_by"] = "01_make_a_map";

  apgm::Map map(header);
  const apgm::Frame& frame = map.header().frame;
  const apgm::TypeId occupancy = map.header().types.find("occupancy").value();
  const int step = frame.step_for(0.1);  // 12.8 m / 2^7

  // A point names its patch and cell; layers are made when they are first asked for. Channel 0 is m(O), the
  // mass on "occupied", channel 1 is m(F), "free"; what they leave of 1 is m(Omega), "not known".
  const auto set = [&](apgm::Point p, float occupied, float free) {
    const auto [patch, cell] = frame.cell_at(p, step);
    apgm::Layer& layer = map.layer(patch, occupancy, step);
    layer.at(0, cell) = occupied;
    layer.at(1, cell) = free;
  };
  const apgm::Point corner = frame.datum_m();
  for (int along = 0; along < 100; ++along) {
    const double x_m = corner.x_m + 5.05 + 0.1 * along;  // over the border of two patches
    for (int before = 0; before < 30; ++before) set({x_m, corner.y_m + 2.05 + 0.1 * before}, 0.0f, 0.7f);
    set({x_m, corner.y_m + 5.05}, 0.9f, 0.0f);
  }
  return map;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: 01_make_a_map OUTPUT.apgm\n", stderr);
    return 2;
  }
  try {
    const apgm::Map map = make_map();
    apgm::Writer writer(argv[1], map.header());
    apgm::copy(map, map.header().types, writer, /*reencode=*/false);
    writer.finish();  // only now does the file appear, whole
    std::printf("%s: %llu patches, %llu bytes, content %s\n", argv[1],
                static_cast<unsigned long long>(writer.report().patches),
                static_cast<unsigned long long>(writer.report().file_bytes),
                writer.report().content_id.c_str());
    return 0;
  } catch (const apgm::Error& e) {
    std::fprintf(stderr, "01_make_a_map: error: %s\n", e.what());
    return e.code() == apgm::ErrorCode::kOutput ? 5 : 70;
  }
}
