#pragma once

#include <memory>
#include <vector>

#include "apgm/layouts/layout.hpp"
#include "fuse/regrid_cells.hpp"

namespace apgm::layouts {

/// One cell from the parts of others, by area (docs/theory.md, "Arbitrary ratio or offset"): any number of
/// cells of any size and shape. Reused from cell to cell.
class CellPool {
 public:
  /// @param schema  outlives the pool
  explicit CellPool(const CellSchema& schema);

  void clear();
  /// @param of_source  shared area / area of `cell`
  /// @param of_target  shared area / area of the cell that is made
  void add(const float* cell, double of_source, double of_target);
  /// The same for the channels of one type, which begin at `channels`.
  void add(TypeId type, const float* channels, double of_source, double of_target);
  /// Writes the values of all types; without data where nothing with data was added.
  void restore(float* cell) const;
  void restore(TypeId type, float* channels) const;

 private:
  struct OfType {
    std::unique_ptr<fuse::CellModel> model;
    std::vector<double> sums;
    std::vector<double> values;
    bool has_data = false;
  };
  const CellSchema& schema_;
  std::vector<OfType> types_;
};

}  // namespace apgm::layouts
