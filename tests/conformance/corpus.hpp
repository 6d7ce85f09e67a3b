#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace apgm::test {

struct GoodFile {
  std::string name;
  std::string bytes;
};

struct BadFile {
  std::string name;
  std::string refused;  ///< "damaged", "unsupported" or "foreign"
  std::string rule;     ///< that is broken, as docs/format.md has it
  std::string bytes;
  /// Who finds it: "reading", "commits" or "verification" (docs/conformance.md).
  std::string by = "reading";
};

/// Bytes of a stream. What a receiver must count, but for 0, is written by hand.
struct StreamFile {
  std::string name;
  std::string rule;  ///< what it shows
  std::string bytes;
  std::map<std::string, std::uint64_t> counts = {};
};

/// Files as the library's writer makes them.
std::vector<GoodFile> written_files();
/// Files that are right but that the writer does not make: what later versions and other writers may do.
std::vector<GoodFile> foreign_made_files();
/// Archives: the same two kinds.
std::vector<GoodFile> written_archives();
std::vector<GoodFile> foreign_made_archives();
/// Streams of which nothing is missing, and others.
std::vector<StreamFile> good_streams();
std::vector<StreamFile> lossy_streams();

}  // namespace apgm::test
