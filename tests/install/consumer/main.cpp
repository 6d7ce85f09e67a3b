// A program of somebody else: uses only what `cmake --install` put in place.
#include <cstdio>

#include <apgm/core/map.hpp>
#include <apgm/format/reader.hpp>
#include <apgm/format/writer.hpp>
#include <apgm/ops/copy.hpp>

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  apgm::MapHeader header;
  header.types = apgm::TypeTable({apgm::LayerType::occupancy()});
  apgm::Map map(header);
  map.layer({0, 0}, 0, 7).at(0, {3, 4}) = 0.75f;
  apgm::Writer writer(argv[1], header);
  apgm::copy(map, header.types, writer, false);
  writer.finish();
  const apgm::Reader reader(argv[1]);
  std::puts(reader.content_id().c_str());
  return reader.content_id() == writer.report().content_id && reader.summary().patches == 1 ? 0 : 1;
}
