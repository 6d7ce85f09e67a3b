#include "totals.hpp"

namespace apgm::ops {

void add_layer(const LayerInfo& info, const TypeTable& types, Summary& summary) {
  Summary::OfType& totals = summary.types[info.type];
  ++totals.layers;
  ++totals.layers_at[info.step];
  totals.stored_bytes += info.stored_bytes;
  totals.raw_bytes += (std::uint64_t{sizeof(float)} << (2 * info.step)) * types[info.type].channels.size();
}

}  // namespace apgm::ops

namespace apgm {

Summary totals_of(const PatchSource& source) {
  const TypeTable& types = source.header().types;
  Summary summary;
  summary.types.resize(types.size());
  PatchInfo patch;
  for (const auto cursor = source.patches(); cursor->next(patch);) {
    ++summary.patches;
    summary.range.add(patch.patch);
    for (const LayerInfo& info : patch.layers) ops::add_layer(info, types, summary);
  }
  return summary;
}

}  // namespace apgm
