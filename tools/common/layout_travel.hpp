#pragma once

#include <cstdint>
#include <memory>

#include "apgm/layouts/layout.hpp"

namespace apgm::tools {

/// A layout that moves, on its way through a drive. What it holds it keeps until it leaves.
class TravellingLayout {
 public:
  /// @param timed  measure how long shifts take
  TravellingLayout(std::unique_ptr<Layout> layout, bool timed);

  /// Shifts the layout if the vehicle left its snapped position; patches of the map that meet what entered
  /// are filled in. The first place is none that it moved to.
  /// @param map  nullptr: what enters stays without data
  void move_to(Point vehicle, const PatchSource* map);
  Layout& layout() { return *layout_; }
  const Layout& layout() const { return *layout_; }

  /// How often it shifted, and for how long together, since the last call.
  struct Shifts {
    std::uint64_t count = 0;
    double spent_ns = 0;  ///< 0 if not timed; without filling
  };
  Shifts take_shifts();

 private:
  std::unique_ptr<Layout> layout_;
  Area extent_;
  bool timed_, placed_ = false;
  Shifts shifts_;
};

}  // namespace apgm::tools
