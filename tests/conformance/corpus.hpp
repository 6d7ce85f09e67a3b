#pragma once

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
  /// Found by whoever reads the whole file and nothing else.
  bool only_by_verification = false;
};

/// Files as the library's writer makes them.
std::vector<GoodFile> written_files();
/// Files that are right but that the writer does not make: what later versions and other writers may do.
std::vector<GoodFile> foreign_made_files();

}  // namespace apgm::test
