#include "apgm/format/version.hpp"

#include <flatbuffers/base.h>
#include <zstd.h>

#include "block.hpp"

namespace apgm {

Versions versions() {
  return {APGM_VERSION, std::to_string(format::kMajor) + "." + std::to_string(format::kMinor),
          ZSTD_versionString(),
          std::to_string(FLATBUFFERS_VERSION_MAJOR) + "." + std::to_string(FLATBUFFERS_VERSION_MINOR) + "." +
              std::to_string(FLATBUFFERS_VERSION_REVISION)};
}

}  // namespace apgm
