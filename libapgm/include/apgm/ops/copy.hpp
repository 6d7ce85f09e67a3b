#pragma once

#include <cstdint>
#include <span>

#include "apgm/core/source.hpp"
#include "apgm/ops/run.hpp"

namespace apgm {

struct CopyReport {
  std::uint64_t patches = 0;  ///< that reached the sink
  std::uint64_t layers = 0;
  std::uint64_t layers_stored = 0;  ///< of these, passed on as stored bytes
};

/// Streams a source into a sink whose types are `sink_types` (a superset by name), all layers or those named.
/// Types that `sink_types` lacks are left out. The caller calls PatchSink::finish.
/// @param reencode  decode and encode every layer, also where stored bytes could be passed on
CopyReport copy(const PatchSource& source, const TypeTable& sink_types, PatchSink& sink, bool reencode,
                const RunOptions& run = {});

/// The least RunOptions::max_memory_bytes that `copy` takes.
/// @param layer_bytes  values of the largest layer of each type, bytes
std::uint64_t least_copy_memory(std::span<const std::uint64_t> layer_bytes);

}  // namespace apgm
