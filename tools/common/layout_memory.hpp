#pragma once

#include <cstdint>

#include "apgm/layouts/layout.hpp"
#include "tools/common/comparison.hpp"

namespace apgm::tools {

/// What a comparison takes, from above and before anything is made: files that are held on their way to be
/// counted may be as large as their cells.
class LayoutMemory {
 public:
  LayoutMemory(const TypeTable& types, const Frame& frame, const CompareOptions& options);

  /// The layouts that travel with the vehicle.
  double travelling_bytes() const { return travelling_; }
  /// The longest shift of one of them.
  double shift_bytes() const { return 3 * largest_; }
  /// Rows of a map, one after the other, beside the map and the layouts that travel.
  double row_bytes(const PatchSource& map) const;
  /// What comes back from other formats, as cells of the finest size.
  static double back_bytes(const PatchSource& map, double finest_cell_m);

 private:
  void add_grid(double cells, double cells_in_file);
  /// A layer with the finest cells on its way into a layout or back: native, merged or split, and both again.
  double work_bytes() const;

  const CompareOptions& options_;
  int values_ = 0;
  Frame frame_;
  double travelling_ = 0, largest_ = 0, largest_file_ = 0;
};

/// Values of a map and the nodes around them.
double map_bytes(const PatchSource& map);

}  // namespace apgm::tools
