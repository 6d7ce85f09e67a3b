// apgm-verify --deep. What it calls sound is read without an error.

#include "apgm/format/verify.hpp"

#include "apgm/format/reader.hpp"
#include "fuzz.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace apgm;
  const std::string path = fuzz::put("input.apgm", fuzz::text_of(data, size));
  bool valid = false;
  fuzz::survives([&] {
    VerifyOptions options;
    options.deep = true;
    options.threads = 1;
    const VerifyReport report = verify(path, options);
    valid = report.valid();
    if (valid != (report.problems.empty() && report.uncommitted_bytes == 0))
      fuzz::fail("problems are not told");
    for (const Problem& problem : report.problems) fuzz::check_text(problem.text);
  });
  if (!valid) return 0;
  if (!fuzz::survives([&] { fuzz::walk(Reader(path)); }))
    fuzz::fail("a file that passes verification is not read");
  return 0;
}
