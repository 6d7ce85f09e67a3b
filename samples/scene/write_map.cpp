#include "scene/write_map.hpp"

#include "apgm/format/writer.hpp"
#include "apgm/ops/copy.hpp"

namespace apgm::samples {

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
