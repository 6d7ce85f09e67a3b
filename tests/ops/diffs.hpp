#pragma once

#include <algorithm>
#include <vector>

#include "apgm/format/writer.hpp"
#include "apgm/ops/copy.hpp"
#include "apgm/ops/diff.hpp"
#include "edited_map.hpp"
#include "random_map.hpp"

namespace apgm::test {

inline DiffReport compare(const PatchSource& a, const PatchSource& b, const DiffOptions& options = {},
                          int threads = 1) {
  RunOptions run;
  run.threads = threads;
  return diff({&a, "a"}, {&b, "b"}, options, run);
}

inline DiffOptions belief(double tolerance) {
  DiffOptions options;
  options.level = DiffLevel::kBelief;
  options.tolerance = tolerance;
  return options;
}

/// A map of one layer type, one patch, one cell for each value: row by row, 4^step of them.
inline Map one_layer(const LayerType& type, int step, const std::vector<std::vector<float>>& channels,
                     PatchIndex patch = {0, 0}) {
  MapHeader header;
  header.types = TypeTable({type});
  Map map(header);
  Layer& layer = map.layer(patch, 0, step);
  for (std::size_t c = 0; c < channels.size(); ++c) {
    std::ranges::copy(channels[c], layer.plane(static_cast<int>(c)).begin());
  }
  return map;
}

inline std::vector<std::byte> file_of(const Map& map, const WriterOptions& options = {}) {
  std::vector<std::byte> bytes;
  Writer writer(bytes, map.header(), options);
  copy(map, map.header().types, writer, true);
  writer.finish();
  return bytes;
}

inline Edits same_spaces() {
  Edits edits;
  edits.other_types = false;
  return edits;
}

}  // namespace apgm::test
