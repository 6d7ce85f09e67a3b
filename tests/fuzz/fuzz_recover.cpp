// What is left of a damaged file. A file written from it is sound.

#include "apgm/format/recover.hpp"

#include "apgm/format/message.hpp"
#include "fuzz.hpp"

namespace {

constexpr std::uint64_t kMaxBytes = std::uint64_t{16} << 20;

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace apgm;
  const std::string path = fuzz::put("input.apgm", fuzz::text_of(data, size));
  std::vector<std::byte> saved;
  fuzz::survives([&] {
    RecoverOptions options;
    options.threads = 1;
    const Recovery recovery(path, options);
    for (const Loss& loss : recovery.report().losses) fuzz::check_text(loss.text);
    fuzz::walk(recovery);
    saved = to_bytes(recovery, {.output = {}, .level = 1});
  });
  if (saved.empty()) return 0;
  try {
    map_from_bytes(saved, kMaxBytes);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kLimit) fuzz::fail("what was saved is not sound: " + error.message());
  }
  return 0;
}
