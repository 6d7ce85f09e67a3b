#pragma once

#include <string>

namespace apgm {

struct Versions {
  std::string library;
  std::string format;  ///< of sealed maps and streams that are written; all of the same major are read
  std::string archive_format;  ///< of archives that are written
  std::string zstd;
  std::string flatbuffers;
};
/// Versions of what is linked.
Versions versions();

}  // namespace apgm
