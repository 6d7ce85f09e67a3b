#pragma once

#include <vector>

#include "converters/common/listed_source.hpp"
#include "converters/numpy/meta.hpp"

namespace apgm::converters {

/// An array in memory and what it means.
struct CellArray {
  ArrayMeta meta;
  std::int64_t rows = 0, columns = 0;
  std::vector<float> values;  ///< (channels, rows, columns)
};

/// Arrays seen as patches: a layer of an array's type where it holds data.
class ArraySource final : public ListedSource {
 public:
  /// @throws Error{kDamaged} that names array, channel, row and column of a value that cannot be a cell's, or
  ///         two arrays that hold data of one layer in one patch; {kLimit} as PatchMarks
  ArraySource(MapHeader header, std::vector<CellArray> arrays);
  void load(const LayerInfo& info, Layer& out) const override;

 private:
  struct Part {
    CellArray cells;
    TypeId type = 0;
    std::vector<PatchIndex> patches;  ///< with data, sorted
  };
  void layers_of(PatchIndex patch, std::vector<LayerInfo>& out) const override;

  std::vector<Part> parts_;  ///< by type
};

}  // namespace apgm::converters
