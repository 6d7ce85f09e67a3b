// The areas of a GeoJSON text, and the patches they meet.

#include "apgm/core/polygon.hpp"
#include "fuzz.hpp"
#include "tools/common/geojson.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace apgm;
  fuzz::survives([&] {
    const Polygon polygon = tools::parse_geojson(std::string(fuzz::text_of(data, size)), "input.geojson");
    const PolygonArea area(polygon, Frame{});
    std::vector<std::uint8_t> keep;
    area.cover(area.range().min);
    area.keep_centres(area.range().max, 3, keep);
  });
  return 0;
}
