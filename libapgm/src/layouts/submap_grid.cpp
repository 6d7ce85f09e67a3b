#include "apgm/layouts/submap_grid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "apgm/core/error.hpp"
#include "apgm/layouts/description.hpp"
#include "layouts/geometry.hpp"
#include "layouts/tile_containers.hpp"
#include "layouts/tile_quadtree.hpp"
#include "layouts/tiles.hpp"

namespace apgm {
namespace layouts {
namespace {

constexpr std::uint64_t kMaxTileBytes = std::uint64_t{1} << 30;
constexpr std::int64_t kMaxReserve = std::int64_t{1} << 24;

/// Sub-maps of one resolution in a container of tiles.
template <template <class> class Container, class Tile>
class SubMapGrid final : public Layout {
 public:
  SubMapGrid(CellSchema schema, const Frame& frame, int step, SubMapContainer kind, double horizon_m)
      : schema_(std::move(schema)),
        frame_(frame),
        kind_(kind),
        side_(1 << step),
        cell_um_(frame.edge_um >> step),
        horizon_m_(horizon_m),
        floats_(static_cast<std::size_t>(side_) * static_cast<std::size_t>(side_) *
                static_cast<std::size_t>(schema_.values())) {}

  std::string name() const override { return "submaps-" + std::string(to_string(kind_)); }
  const CellSchema& schema() const override { return schema_; }
  const Frame& frame() const override { return frame_; }

  void move_to(Point vehicle) override {
    const Offset at = offset_of(frame_, vehicle);
    if (horizon_m_ == 0) return;
    tiles_.erase_if([&](PatchIndex i) { return distance_m(i, at) > horizon_m_; });
  }

  const float* find(Point p) const override {
    const Place place = place_of(p);
    const Tile* tile = tiles_.find(place.patch);
    return tile == nullptr ? nullptr : tile->read() + place.at;
  }

  float* insert(Point p) override {
    const Place place = place_of(p);
    Tile* tile = tiles_.find(place.patch);
    if (tile == nullptr) {
      make(place.patch);
      tile = tiles_.find(place.patch);
    }
    return tile->edit(floats_) + place.at;
  }

  void reserve(const Area& area) override {
    const PatchRange range = patches_in(frame_, area);
    if (range.empty()) return;
    const std::int64_t width = std::int64_t{range.max.x} - range.min.x + 1;
    const std::int64_t height = std::int64_t{range.max.y} - range.min.y + 1;
    if (width > kMaxReserve / height) throw Error(ErrorCode::kLimit, "the area holds too many sub-maps");
    for (std::int64_t y = range.min.y; y <= range.max.y; ++y) {
      for (std::int64_t x = range.min.x; x <= range.max.x; ++x) {
        const PatchIndex i{static_cast<std::int32_t>(x), static_cast<std::int32_t>(y)};
        if (tiles_.find(i) == nullptr) make(i);
      }
    }
  }

  void for_each_block(const std::function<void(const CellBlock&)>& visit) const override {
    tiles_.for_each([&](PatchIndex i, const Tile& tile) { visit(block(i, tile)); });
  }

  void edit_blocks(const Area& area, const std::function<void(const CellBlock&, float*)>& visit) override {
    const PatchRange range = patches_in(frame_, area);
    if (range.empty()) return;
    const std::int64_t width = std::int64_t{range.max.x} - range.min.x + 1;
    const std::int64_t height = std::int64_t{range.max.y} - range.min.y + 1;
    if (width > static_cast<std::int64_t>(tiles_.size()) / height) {
      tiles_.for_each([&](PatchIndex i, Tile& tile) {
        if (range.contains(i)) edit(i, tile, visit);
      });
      return;
    }
    for (std::int64_t y = range.min.y; y <= range.max.y; ++y) {
      for (std::int64_t x = range.min.x; x <= range.max.x; ++x) {
        const PatchIndex i{static_cast<std::int32_t>(x), static_cast<std::int32_t>(y)};
        if (Tile* tile = tiles_.find(i)) edit(i, *tile, visit);
      }
    }
  }

  std::unique_ptr<Layout> snapshot() const override {
    return std::make_unique<SubMapGrid>(*this, tiles_.clone(floats_));
  }

  Footprint footprint() const override {
    Footprint f = count_cells(*this);
    f.allocated_bytes = tiles_.size() * Tile::bytes(floats_) + tiles_.table_bytes();
    return f;
  }

  LayoutDescription describe() const override {
    LayoutDescription d;
    d.name = name();
    d.frame = frame_;
    d.container = kind_;
    d.cell_m = static_cast<double>(cell_um_) / 1e6;
    d.horizon_m = horizon_m_;
    return d;
  }

  /// All of `other` but its tiles.
  SubMapGrid(const SubMapGrid& other, Container<Tile> tiles)
      : schema_(other.schema_),
        frame_(other.frame_),
        kind_(other.kind_),
        side_(other.side_),
        cell_um_(other.cell_um_),
        horizon_m_(other.horizon_m_),
        floats_(other.floats_),
        tiles_(std::move(tiles)) {}

 private:
  struct Place {
    PatchIndex patch;
    std::int64_t at = 0;  // in floats
  };

  Place place_of(Point p) const {
    const Offset offset = offset_of(frame_, p);
    const std::int64_t x = floor_div(offset.x_um, frame_.edge_um);
    const std::int64_t y = floor_div(offset.y_um, frame_.edge_um);
    const PatchIndex patch{static_cast<std::int32_t>(x), static_cast<std::int32_t>(y)};
    if (patch.x != x || patch.y != y) {
      throw Error(ErrorCode::kLimit, "a point lies outside all patch indices");
    }
    const std::int64_t a = (offset.x_um - x * frame_.edge_um) / cell_um_;
    const std::int64_t b = (offset.y_um - y * frame_.edge_um) / cell_um_;
    return {patch, (b * side_ + a) * schema_.values()};
  }

  void make(PatchIndex i) {
    area_of(frame_, i);  // refuses what has no coordinates
    Tile tile(floats_);
    const auto& background = schema_.background();
    float* out = tile.edit(floats_);
    for (float* end = out + floats_; out != end;) out = std::copy(background.begin(), background.end(), out);
    tiles_.insert(i, std::move(tile));
  }

  CellBlock block(PatchIndex i, const Tile& tile) const {
    const Area area = area_of(frame_, i);
    return {area.x0_um, area.y0_um, cell_um_, cell_um_, side_, side_, std::int64_t{side_} * schema_.values(),
            tile.read()};
  }

  void edit(PatchIndex i, Tile& tile, const std::function<void(const CellBlock&, float*)>& visit) {
    float* cells = tile.edit(floats_);
    visit(block(i, tile), cells);
  }

  /// From a point to the square of a sub-map.
  double distance_m(PatchIndex i, Offset at) const {
    const auto apart = [&](std::int32_t index, std::int64_t um) {
      const double low = static_cast<double>(index) * static_cast<double>(frame_.edge_um);
      const double v = static_cast<double>(um);
      return std::max({low - v, v - low - static_cast<double>(frame_.edge_um), 0.0}) / 1e6;
    };
    const double x = apart(i.x, at.x_um), y = apart(i.y, at.y_um);
    return std::sqrt(x * x + y * y);
  }

  CellSchema schema_;
  Frame frame_;
  SubMapContainer kind_;
  int side_;
  std::int64_t cell_um_;
  double horizon_m_;
  std::size_t floats_;
  Container<Tile> tiles_;
};

int step_of(const Frame& frame, double cell_m) {
  const std::int64_t cell = whole_um(cell_m, "the side of a cell");
  for (int step = 0; step <= kMaxStep; ++step) {
    if (cell > 0 && cell << step == frame.edge_um) return step;
  }
  throw Error(ErrorCode::kInvalidArgument, "the patch edge is not the side of a cell times a power of two")
      .hint("a side of edge / 2^r, r = 0..11, of whole micrometres");
}

}  // namespace
}  // namespace layouts

std::string_view to_string(SubMapContainer container) {
  switch (container) {
    case SubMapContainer::kDenseArray:
      return "dense_array";
    case SubMapContainer::kHashMap:
      return "hash_map";
    case SubMapContainer::kQuadtree:
      return "quadtree";
    case SubMapContainer::kSortedVector:
      return "sorted_vector";
    case SubMapContainer::kCowTiles:
      return "cow_tiles";
  }
  return "";
}

std::optional<SubMapContainer> submap_container_from(std::string_view name) {
  for (const SubMapContainer container : kSubMapContainers) {
    if (to_string(container) == name) return container;
  }
  return {};
}

std::unique_ptr<Layout> make_submap_grid(CellSchema schema, const Frame& frame, double cell_m,
                                         SubMapContainer container, double horizon_m) {
  using namespace layouts;
  frame.check();
  const int step = step_of(frame, cell_m);
  if (!(horizon_m >= 0) || !std::isfinite(horizon_m)) {
    throw Error(ErrorCode::kInvalidArgument, "a horizon is a number of metres, 0 or above");
  }
  const std::uint64_t cell_bytes = static_cast<std::uint64_t>(schema.values()) * sizeof(float);
  if ((std::uint64_t{1} << (2 * step)) > kMaxTileBytes / cell_bytes) {
    throw Error(ErrorCode::kLimit, "a sub-map would take more than 1 GiB").hint("choose larger cells");
  }
  switch (container) {
    case SubMapContainer::kDenseArray:
      return std::make_unique<SubMapGrid<DenseTiles, OwnTile>>(std::move(schema), frame, step, container,
                                                               horizon_m);
    case SubMapContainer::kHashMap:
      return std::make_unique<SubMapGrid<HashedTiles, OwnTile>>(std::move(schema), frame, step, container,
                                                                horizon_m);
    case SubMapContainer::kQuadtree:
      return std::make_unique<SubMapGrid<QuadtreeTiles, OwnTile>>(std::move(schema), frame, step, container,
                                                                  horizon_m);
    case SubMapContainer::kSortedVector:
      return std::make_unique<SubMapGrid<SortedTiles, OwnTile>>(std::move(schema), frame, step, container,
                                                                horizon_m);
    case SubMapContainer::kCowTiles:
      return std::make_unique<SubMapGrid<SortedTiles, SharedTile>>(std::move(schema), frame, step, container,
                                                                   horizon_m);
  }
  throw Error(ErrorCode::kInvalidArgument, "there is no such container");
}

}  // namespace apgm
