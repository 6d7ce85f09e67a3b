#include "apgm/format/version.hpp"

#include <flatbuffers/base.h>
#include <zstd.h>

#include "block.hpp"

namespace apgm {

Versions versions() {
  const std::string major = std::to_string(format::kMajor) + ".";
  return {APGM_VERSION, major + std::to_string(format::kMinor), major + std::to_string(format::kMinorArchive),
          ZSTD_versionString(),
          std::to_string(FLATBUFFERS_VERSION_MAJOR) + "." + std::to_string(FLATBUFFERS_VERSION_MINOR) + "." +
              std::to_string(FLATBUFFERS_VERSION_REVISION)};
}

}  // namespace apgm
