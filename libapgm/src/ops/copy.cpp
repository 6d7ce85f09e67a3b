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

std::uint64_t least_copy_memory(std::span<const std::uint64_t> layer_bytes) {
  return ops::job_bytes(layer_bytes, ops::Transfer::kBuffers);
}

}  // namespace apgm
