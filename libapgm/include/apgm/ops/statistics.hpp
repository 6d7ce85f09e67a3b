#pragma once

#include <cstdint>
#include <vector>

#include "apgm/core/source.hpp"
#include "apgm/ops/run.hpp"

namespace apgm {

/// Counts over all cells of one type. A cell is known if any of its values differs from its background.
struct CellStatistics {
  std::uint64_t cells = 0;
  std::uint64_t known_cells = 0;
  std::uint64_t occupied_cells = 0;  ///< occupancy: known, BetP(O) > 0.5
  std::uint64_t free_cells = 0;      ///< occupancy: known, BetP(O) < 0.5
  double max_mass_sum = 0;           ///< greatest sum of a cell's masses, Omega left out; 0 for real channels
};

/// By TypeId of the source. Reads every layer, in parallel, with bounded memory.
std::vector<CellStatistics> statistics(const PatchSource& source, const RunOptions& run = {});

/// The summary of a source that has to walk its patches for it; no layer is read.
Summary totals_of(const PatchSource& source);

}  // namespace apgm
