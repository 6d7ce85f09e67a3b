#include "tools/common/layout_travel.hpp"

#include <algorithm>
#include <chrono>
#include <utility>
#include <vector>

#include "tools/common/source_view.hpp"

namespace apgm::tools {
namespace {

Area extent_of(const Layout& layout) {
  Area extent;
  bool first = true;
  layout.for_each_block([&](const CellBlock& block) {
    const Area a = block.area();
    extent = first ? a
                   : Area{std::min(extent.x0_um, a.x0_um), std::min(extent.y0_um, a.y0_um),
                          std::max(extent.x1_um, a.x1_um), std::max(extent.y1_um, a.y1_um)};
    first = false;
  });
  return extent;
}

/// What lies in `to` and not in `from`, which is as large: a strip along each axis, or all of it.
std::vector<Area> entering(const Area& from, const Area& to) {
  if (!from.meets(to)) return {to};
  std::vector<Area> strips;
  if (to.x1_um > from.x1_um) strips.push_back({from.x1_um, to.y0_um, to.x1_um, to.y1_um});
  if (to.x0_um < from.x0_um) strips.push_back({to.x0_um, to.y0_um, from.x0_um, to.y1_um});
  if (to.y1_um > from.y1_um) strips.push_back({to.x0_um, from.y1_um, to.x1_um, to.y1_um});
  if (to.y0_um < from.y0_um) strips.push_back({to.x0_um, to.y0_um, to.x1_um, from.y0_um});
  return strips;
}

Box box_of(const Area& a) {
  const auto metres = [](std::int64_t um) { return static_cast<double>(um) / 1e6; };
  return {{metres(a.x0_um), metres(a.y0_um)}, {metres(a.x1_um), metres(a.y1_um)}};
}

}  // namespace

TravellingLayout::TravellingLayout(std::unique_ptr<Layout> layout, bool timed)
    : layout_(std::move(layout)), extent_(extent_of(*layout_)), timed_(timed) {}

void TravellingLayout::move_to(Point vehicle, const PatchSource* map) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point start = timed_ ? Clock::now() : Clock::time_point{};
  layout_->move_to(vehicle);
  const Clock::time_point end = timed_ ? Clock::now() : start;
  const Area before = std::exchange(extent_, extent_of(*layout_));
  if (std::exchange(placed_, true) && before != extent_) {
    ++shifts_.count;
    shifts_.spent_ns += std::chrono::duration<double, std::nano>(end - start).count();
    if (map == nullptr) return;
    for (const Area& strip : entering(before, extent_)) {
      fill(*layout_, SourceView(*map, {}, box_of(strip)));
    }
  }
}

TravellingLayout::Shifts TravellingLayout::take_shifts() { return std::exchange(shifts_, {}); }

}  // namespace apgm::tools
