#pragma once

#include <string>

namespace apgm {

struct Versions {
  std::string library;
  std::string format;
  std::string zstd;
  std::string flatbuffers;
};
/// Versions of what is linked.
Versions versions();

}  // namespace apgm
