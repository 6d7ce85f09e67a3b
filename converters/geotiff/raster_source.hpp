#pragma once

#include <functional>
#include <memory>

#include "apgm/core/working_memory.hpp"
#include "converters/common/grid_fit.hpp"
#include "converters/common/listed_source.hpp"
#include "converters/geotiff/cell_rule.hpp"
#include "converters/geotiff/raster.hpp"

namespace apgm::converters {

struct RasterPlan {
  std::shared_ptr<const Raster> raster;
  std::shared_ptr<const PixelRule> rule;
  GridFit fit;
  bool keep_invalid_out = false;  ///< invalid cells become unknown, and are counted; else they are errors
  MapHeader header;               ///< frame and types are set by the source
  std::map<PatchIndex, std::int64_t> stamps_ns;
};

/// A raster seen as patches of one layer. Every pixel is read and checked once when it is made; the cells of
/// a patch are read again when they are loaded, so memory holds no more than GDAL's cache and a patch.
class RasterSource final : public ListedSource, public WorkingMemory {
 public:
  /// @throws Error{kDamaged} that names band and pixel of the first invalid cell, {kLimit} as PatchMarks
  explicit RasterSource(RasterPlan plan);
  void load(const LayerInfo& info, Layer& out) const override;
  std::uint64_t working_bytes(std::uint64_t layer_bytes) const override;
  const RasterTally& tally() const { return tally_; }

 private:
  class Pixels;
  void layers_of(PatchIndex patch, std::vector<LayerInfo>& out) const override;
  void scan();
  void scan(const Window& window, Pixels& pixels, PatchMarks& marks);

  RasterPlan plan_;
  RasterTally tally_;
};

}  // namespace apgm::converters
