#include "apgm/ops/copy.hpp"

#include "transfer.hpp"

namespace apgm {

CopyReport copy(const PatchSource& source, const TypeTable& sink_types, PatchSink& sink, bool reencode,
                const RunOptions& run) {
  ops::Transfer transfer(source, sink_types, sink);
  transfer.reencode = reencode;
  const ops::TransferReport report = transfer.run(run);
  return {report.patches, report.layers, report.layers_stored};
}

}  // namespace apgm
