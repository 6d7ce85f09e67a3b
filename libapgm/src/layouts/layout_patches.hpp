#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "apgm/core/map.hpp"
#include "apgm/layouts/layout.hpp"
#include "layouts/geometry.hpp"

namespace apgm::layouts {

/// A layout seen in the patches of a frame, whose layers are made one patch at a time. The layout must
/// outlive it and not move.
class LayoutPatches {
 public:
  /// A block that reaches into a patch.
  struct Part {
    const CellBlock* block = nullptr;
    CellWindow window;
    int step = 0;  // of the shorter side of its cells
    bool is_square() const { return block->cell_x_um == block->cell_y_um; }
  };

  /// @throws Error{kIncompatible} if the cells do not fall on those of `frame`
  LayoutPatches(const Layout& layout, const Frame& frame);
  LayoutPatches(const LayoutPatches&) = delete;
  LayoutPatches& operator=(const LayoutPatches&) = delete;

  /// The layers with data of a patch, as to_map() says; empty if the layout does not reach there.
  std::map<TypeId, Layer> layers(PatchIndex patch) const;
  /// All patches it reaches into, in key order.
  std::vector<PatchIndex> reached() const;

 private:
  const Layout& layout_;
  Frame frame_;
  std::vector<CellBlock> blocks_;
  std::map<std::pair<std::uint64_t, PatchIndex>, std::vector<Part>> parts_;  // by curve_key
};

}  // namespace apgm::layouts
