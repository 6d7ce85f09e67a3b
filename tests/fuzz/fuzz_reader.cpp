// Opening an .apgm file, walking its index, loading its layers.

#include "apgm/format/reader.hpp"
#include "fuzz.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  apgm::fuzz::survives([&] {
    const apgm::Reader reader(apgm::fuzz::bytes_of(data, size));
    reader.summary();
    apgm::fuzz::walk(reader);
  });
  return 0;
}
