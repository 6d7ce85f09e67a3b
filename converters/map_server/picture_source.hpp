#pragma once

#include <array>
#include <vector>

#include "converters/common/belief.hpp"
#include "converters/common/grid_fit.hpp"
#include "converters/common/listed_source.hpp"
#include "converters/map_server/map_yaml.hpp"

namespace apgm::converters {

/// The cells of a picture, one byte each, the top row first.
struct CellRaster {
  std::int64_t width = 0;
  std::int64_t height = 0;
  std::vector<GridValue> values;

  GridValue at(std::int64_t x, std::int64_t y_from_bottom) const {
    return values[static_cast<std::size_t>((height - 1 - y_from_bottom) * width + x)];
  }
};

/// Reads a picture by the map's rule.
/// @param max_memory_bytes  bound of the file, the cells and what decoding takes; 0: none
/// @throws Error as read_picture; over_budget()
CellRaster read_cells(const std::string& path, const CellRule& rule, std::uint64_t max_memory_bytes = 0);

/// Belief of each value: [value + 1], so that unknown comes first.
using BeliefTable = std::array<Masses, 102>;

/// A picture seen as patches of one layer `occupancy`. Cell (0, 0) is the picture's lower-left pixel.
class PictureSource final : public ListedSource {
 public:
  /// @param max_memory_bytes  what the list of patches may take; 0: no bound
  PictureSource(CellRaster cells, const BeliefTable& beliefs, const GridFit& fit,
                std::map<std::string, std::string> metadata, std::uint64_t max_memory_bytes = 0);
  void load(const LayerInfo& info, Layer& out) const override;

 private:
  void layers_of(PatchIndex patch, std::vector<LayerInfo>& out) const override;

  CellRaster cells_;
  BeliefTable beliefs_;
  GridFit fit_;
};

}  // namespace apgm::converters
