#include "scene/write_map.hpp"

#include <filesystem>

#include "apgm/core/error.hpp"
#include "apgm/format/writer.hpp"
#include "apgm/ops/copy.hpp"

namespace apgm::samples {

void check_absent(const std::string& path) {
  if (!std::filesystem::exists(path)) return;
  throw Error(ErrorCode::kOutput, "output '" + path + "' already exists")
      .hint("pass --overwrite to replace it");
}

void write_map(const Map& map, const std::string& path, bool overwrite) {
  WriterOptions options;
  options.output.overwrite = overwrite;
  Writer writer(path, map.header(), options);
  RunOptions run;
  run.threads = 1;
  copy(map, map.header().types, writer, /*reencode=*/false, run);
  writer.finish();
}

}  // namespace apgm::samples
