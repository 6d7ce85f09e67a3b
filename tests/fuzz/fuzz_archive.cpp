// The commits of an archive, and each of them as a map.

#include "apgm/format/reader.hpp"
#include "fuzz.hpp"

namespace {

constexpr std::size_t kMostCommits = 8;

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace apgm;
  const auto bytes = fuzz::bytes_of(data, size);
  fuzz::survives([&] {
    const auto commits = Reader(bytes).commits();
    if (commits.empty()) fuzz::fail("an archive without commits");
    for (std::size_t i = 0; i < std::min(commits.size(), kMostCommits); ++i) {
      const std::uint64_t number = commits[i].number;
      if (i > 0 && number <= commits[i - 1].number) fuzz::fail("commits do not ascend");
      fuzz::survives([&] {
        const Reader reader(bytes, "archive", {.commit = number});
        if (reader.file().commits != number) fuzz::fail("another commit was opened");
        if (reader.content_id() != commits[i].content_id) fuzz::fail("a commit has another content");
        fuzz::walk(reader);
      });
    }
  });
  return 0;
}
