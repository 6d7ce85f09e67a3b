// Messages of maps and of changes; what is taken in can be sent on, and comes back as it was.

#include "apgm/format/message.hpp"
#include "fuzz.hpp"
#include "random_map.hpp"

namespace {

constexpr std::uint64_t kMaxBytes = std::uint64_t{8} << 20;

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace apgm;
  const auto bytes = fuzz::bytes_of(data, size);
  fuzz::survives([&] {
    const MapChanges changes = changes_from_bytes(bytes, kMaxBytes);
    const MapChanges again = changes_from_bytes(to_bytes(changes, {.output = {}, .level = 1}), kMaxBytes);
    const std::string what = test::difference(changes.changed, again.changed, true);
    if (!what.empty()) fuzz::fail("changes came back otherwise: " + what);
    if (changes.gone != again.gone) fuzz::fail("what is gone came back otherwise");
  });
  fuzz::survives([&] { map_from_bytes(bytes, kMaxBytes); });
  return 0;
}
