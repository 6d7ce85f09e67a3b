// The FlatBuffer of a MapHeader block. What is read is written, and reads back the same.

#include "fuzz.hpp"
#include "map_header.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace apgm;
  std::vector<std::byte> block;
  format::append_block(block, format::Kind::kMapHeader, 0, fuzz::bytes_of(data, size), {});
  fuzz::survives([&] {
    const MapHeader header = format::read_map_header(block);
    std::vector<std::byte> written;
    format::append_map_header(written, header);
    const MapHeader again = format::read_map_header(written);
    if (again.types != header.types || again.metadata != header.metadata || again.history != header.history ||
        again.stamp_ns != header.stamp_ns) {
      fuzz::fail("a header came back otherwise");
    }
  });
  return 0;
}
