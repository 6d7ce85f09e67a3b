#pragma once

#include <string>
#include <vector>

#include "apgm/core/polygon.hpp"
#include "apgm/core/source.hpp"
#include "apgm/ops/run.hpp"

namespace apgm {

enum class Snap : std::uint8_t {
  kCell,   ///< keep every cell that shares area with the region
  kPatch,  ///< keep every patch that does
};

struct CropRegion {
  std::optional<Box> box;
  std::optional<Polygon> polygon;     ///< with kCell a cell is kept if its centre lies inside
  const PatchSource* like = nullptr;  ///< keep the patches this source has (same frame)
};

struct CropReport {
  std::uint64_t patches = 0;
  std::uint64_t layers = 0;
  std::uint64_t layers_stored = 0;
  std::uint64_t salvaged = 0;  ///< damaged layers that were left out (salvage only)
};

struct CropOptions {
  Snap snap = Snap::kCell;
  bool salvage = false;             ///< leave out damaged layers, each a kLoss finding, instead of failing
  std::vector<std::string> layers;  ///< names; empty: all
};

/// The header of a crop: that of the source, types filtered by `options.layers`; of a delta without what
/// makes it one (drop_changes).
/// @throws Error{kInvalidArgument} if a named layer does not exist
MapHeader crop_header(const PatchSource& source, const CropRegion& region, const CropOptions& options);

/// Streams the part of `source` inside `region` to `sink`; patches wholly inside pass as stored.
/// An empty result is valid. The caller calls PatchSink::finish. Reads nothing of the source outside the
/// region but index pages that meet it.
CropReport crop(const PatchSource& source, const CropRegion& region, const CropOptions& options,
                PatchSink& sink, const RunOptions& run = {});

}  // namespace apgm
