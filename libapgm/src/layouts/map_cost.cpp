#include <algorithm>
#include <limits>
#include <optional>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/layouts/comparison.hpp"
#include "layouts/cost_meter.hpp"

namespace apgm {
namespace {

using layouts::ReadBits;

/// A cell of a layer of the map.
struct Place {
  PatchIndex patch;
  TypeId type = 0;
  int step = 0;
  Point centre;
};

class MapMeter {
 public:
  MapMeter(const Map& map, std::uint64_t seed, const CostOptions& options)
      : map_(map), frame_(map.header().frame), options_(options), watch_(options) {
    layouts::CellDraws draws(seed);
    std::vector<Place> layers;
    for (const auto& [key, patch] : map.by_key()) {
      range_.add(patch.index);
      for (const auto& [type, layer] : patch.layers) {
        layers.push_back({patch.index, type, layer.step(), {}});
        draws.add_part(layer.cells());
      }
    }
    cells_ = draws.count();
    if (cells_ == 0) throw Error(ErrorCode::kInvalidArgument, "the map holds no cells to measure");
    finest_ = *std::ranges::max_element(layers, {}, &Place::step);
    for (int i = 0; i < options.accesses; ++i) {
      const auto [part, cell] = draws.draw();
      places_.push_back(in_layer(layers[part], cell));
    }
  }

  LayoutCost run() const {
    std::optional<Map> copy;
    LayoutCost cost = layouts::time_accesses(
        watch_, options_,
        {[&] { copy.emplace(map_); }, [&] { find(); }, [&] { iterate(); }, [&] { insert(*copy); }, cells_});
    if (has_room_above()) cost.grow_ns = watch_.time_ns([&] { grow(*copy); }) / options_.growths;
    return cost;
  }

 private:
  Place in_layer(Place place, std::uint64_t cell) const {
    const std::uint64_t side = std::uint64_t{1} << place.step;
    const Point corner = frame_.origin_m(place.patch);
    const double cell_m = frame_.cell_m(place.step);
    place.centre = {corner.x_m + (static_cast<double>(cell % side) + 0.5) * cell_m,
                    corner.y_m + (static_cast<double>(cell / side) + 0.5) * cell_m};
    return place;
  }

  void find() const {
    ReadBits bits;
    for (const Place& place : places_) {
      const Patch* patch = map_.find(frame_.patch_at(place.centre));
      if (patch == nullptr) continue;
      for (const auto& [type, layer] : patch->layers) {
        bits.add(layer.at(0, frame_.cell_at(place.centre, layer.step()).cell));
      }
    }
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
    ReadBits bits;
    for (const auto& [key, patch] : map_.by_key()) {
      for (const auto& [type, layer] : patch.layers) {
        for (int c = 0; c < layer.channels(); ++c) {
          for (const float value : layer.plane(c)) bits.add(value);
        }
      }
    }
  }

  /// Not at the end of all indices.
  bool has_room_above() const {
    constexpr std::int32_t kLast = std::numeric_limits<std::int32_t>::max();
    return range_.max.y < kLast && range_.min.x <= kLast - options_.growths;
  }

  /// Patches in a row above all others.
  void grow(Map& copy) const {
    for (int i = 0; i < options_.growths; ++i) {
      copy.layer({range_.min.x + i, range_.max.y + 1}, finest_.type, finest_.step);
    }
  }

  const Map& map_;
  const Frame& frame_;
  const CostOptions& options_;
  layouts::Stopwatch watch_;
  std::uint64_t cells_ = 0;
  Place finest_;
  PatchRange range_;
  std::vector<Place> places_;
};

}  // namespace

LayoutCost measure_cost(const Map& map, std::uint64_t seed, const CostOptions& options) {
  return MapMeter(map, seed, options).run();
}

}  // namespace apgm
