#include <algorithm>
#include <bit>
#include <chrono>
#include <optional>
#include <random>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/layouts/comparison.hpp"

namespace apgm {
namespace {

std::int64_t steady_now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

/// A cell of a layer of the map.
struct Place {
  PatchIndex patch;
  TypeId type = 0;
  int step = 0;
  Point centre;
};

struct Layers {
  std::vector<Place> all;
  std::vector<std::uint64_t> first;  // number of a layer's first cell
  std::uint64_t cells = 0;
  int finest = 0;
  std::optional<PatchRange> range;
};

Layers layers_of(const Map& map) {
  Layers layers;
  PatchRange range;
  for (const auto& [key, patch] : map.by_key()) {
    range.add(patch.index);
    for (const auto& [type, layer] : patch.layers) {
      layers.all.push_back({patch.index, type, layer.step(), {}});
      layers.first.push_back(layers.cells);
      layers.cells += layer.cells();
      layers.finest = std::max(layers.finest, layer.step());
    }
  }
  if (!range.empty()) layers.range = range;
  return layers;
}

std::vector<Place> random_places(const Frame& frame, const Layers& layers, int count, std::uint64_t seed) {
  std::mt19937_64 draw(seed);
  std::vector<Place> places;
  for (int i = 0; i < count; ++i) {
    const std::uint64_t cell = draw() % layers.cells;
    const auto at =
        static_cast<std::size_t>(std::ranges::upper_bound(layers.first, cell) - layers.first.begin() - 1);
    Place place = layers.all[at];
    const std::uint64_t in_layer = cell - layers.first[at], side = std::uint64_t{1} << place.step;
    const Point corner = frame.origin_m(place.patch);
    const double cell_m = frame.cell_m(place.step);
    place.centre = {corner.x_m + (static_cast<double>(in_layer % side) + 0.5) * cell_m,
                    corner.y_m + (static_cast<double>(in_layer / side) + 0.5) * cell_m};
    places.push_back(place);
  }
  return places;
}

/// Keeps what was read from being optimised away.
void use(std::uint32_t value) { static_cast<void>(*static_cast<volatile std::uint32_t*>(&value)); }

class MapMeter {
 public:
  MapMeter(const Map& map, std::uint64_t seed, const CostOptions& options)
      : map_(map),
        frame_(map.header().frame),
        options_(options),
        now_ns_(options.now_ns ? options.now_ns : steady_now_ns),
        layers_(layers_of(map)) {
    if (options.accesses < 1 || options.shifts < 1 || options.growths < 1) {
      throw Error(ErrorCode::kInvalidArgument, "numbers of accesses, shifts and growths are at least 1");
    }
    if (layers_.cells == 0) throw Error(ErrorCode::kInvalidArgument, "the map holds no cells to measure");
    places_ = random_places(frame_, layers_, options.accesses, seed);
  }

  LayoutCost run() const {
    LayoutCost cost;
    std::optional<Map> copy;
    cost.snapshot_ns = time([&] { copy.emplace(map_); });
    cost.find_ns = time([&] { find(); }) / options_.accesses;
    cost.iterate_ns = time([&] { iterate(); }) / static_cast<double>(layers_.cells);
    insert(*copy);
    cost.insert_ns = time([&] { insert(*copy); }) / options_.accesses;
    cost.grow_ns = time([&] { grow(*copy); }) / options_.growths;
    return cost;
  }

 private:
  template <class Work>
  double time(Work&& work) const {
    const std::int64_t start = now_ns_();
    work();
    return static_cast<double>(now_ns_() - start);
  }

  void find() const {
    std::uint32_t bits = 0;
    for (const Place& place : places_) {
      const Patch* patch = map_.find(frame_.patch_at(place.centre));
      if (patch == nullptr) continue;
      for (const auto& [type, layer] : patch->layers) {
        const CellIndex cell = frame_.cell_at(place.centre, layer.step()).cell;
        bits ^= std::bit_cast<std::uint32_t>(layer.at(0, cell));
      }
    }
    use(bits);
  }

  void insert(Map& copy) const {
    const TypeTable& types = map_.header().types;
    for (const Place& place : places_) {
      const Frame::Cell at = frame_.cell_at(place.centre, place.step);
      Layer& layer = copy.layer(at.patch, place.type, place.step);
      for (int c = 0; c < layer.channels(); ++c) layer.at(c, at.cell) = types[place.type].background(c);
    }
  }

  void iterate() const {
    std::uint32_t bits = 0;
    for (const auto& [key, patch] : map_.by_key()) {
      for (const auto& [type, layer] : patch.layers) {
        for (int c = 0; c < layer.channels(); ++c) {
          for (const float value : layer.plane(c)) bits ^= std::bit_cast<std::uint32_t>(value);
        }
      }
    }
    use(bits);
  }

  /// Patches in a row above all others.
  void grow(Map& copy) const {
    const Place& like = *std::ranges::find(layers_.all, layers_.finest, &Place::step);
    for (int i = 0; i < options_.growths; ++i) {
      copy.layer({layers_.range->min.x + i, layers_.range->max.y + 1}, like.type, like.step);
    }
  }

  const Map& map_;
  const Frame& frame_;
  const CostOptions& options_;
  std::function<std::int64_t()> now_ns_;
  Layers layers_;
  std::vector<Place> places_;
};

}  // namespace

LayoutCost measure_cost(const Map& map, std::uint64_t seed, const CostOptions& options) {
  return MapMeter(map, seed, options).run();
}

}  // namespace apgm
