#include "scene/mapping.hpp"

#include <algorithm>

#include "apgm/core/portable_math.hpp"
#include "apgm/fuse/combine.hpp"
#include "scene/grid.hpp"

namespace apgm::samples {
namespace {

constexpr double kHitMass = 0.7;
constexpr double kHitSpread_m = 0.1;
constexpr double kFreeMass = 0.5;
constexpr double kPixelRelevance = 0.06;  // rho
constexpr float kAgeing = 0.993f;         // from pose to pose
constexpr float kTrueMass = 0.98f;

Map measurement_map(LayerType type, std::int64_t stamp_ns) {
  MapHeader header;
  header.frame = sample_frame();
  header.types = TypeTable({std::move(type)});
  header.stamp_ns = stamp_ns;
  return Map(std::move(header));
}

MapHeader drive_header(std::vector<LayerType> types, const std::string& name, const std::string& sensors) {
  MapHeader header;
  header.frame = sample_frame();
  header.types = TypeTable(std::move(types));
  header.metadata = {{"sample.vehicle", name}, {"sample.sensors", sensors}};
  return header;
}

/// A scene point in cells from the datum.
Point in_cells(Point scene_m, double cell_m) {
  return {(scene_m.x_m + kSceneCorner_m.x_m) / cell_m, (scene_m.y_m + kSceneCorner_m.y_m) / cell_m};
}

/// Centre of a cell, in cells from the datum.
Point centre_of(std::int64_t i, std::int64_t j) {
  return {static_cast<double>(i) + 0.5, static_cast<double>(j) + 0.5};
}

float hit_mass(Point from_centre_m) {
  const double q = dot(from_centre_m, from_centre_m) / (2 * kHitSpread_m * kHitSpread_m);
  return static_cast<float>(kHitMass * portable::exp(-q));
}

void stamp_layers(Map& map, std::int64_t stamp_ns) {
  for (const auto& [key, patch] : map.by_key()) {
    for (auto& [type, layer] : map.patch(patch.index).layers) layer.stamp_ns = stamp_ns;
  }
}

/// Visits the centre of every cell of the scene, in scene metres: visit(i, j, p).
template <class Visit>
void for_each_cell(double cell_m, Visit visit) {
  const Point low = in_cells(Scene::kBounds.min, cell_m);
  const Point high = in_cells(Scene::kBounds.max, cell_m);
  for (auto j = static_cast<std::int64_t>(low.y_m); j < static_cast<std::int64_t>(high.y_m); ++j) {
    for (auto i = static_cast<std::int64_t>(low.x_m); i < static_cast<std::int64_t>(high.x_m); ++i) {
      visit(i, j, cell_m * centre_of(i, j) - kSceneCorner_m);
    }
  }
}

}  // namespace

Frame sample_frame() {
  Frame frame;
  frame.datum_x_um = 570'000'000'000;
  frame.datum_y_um = 5'360'000'000'000;
  frame.epsg = 32632;
  frame.frame_id = "utm";
  return frame;
}

LayerType occupancy_type(Policy policy) { return LayerType::occupancy(kOccupancy, policy); }

LayerType semantic_type() { return LayerType::semantic(kSemantics, {"Road", "Marking", "Blocked"}); }

Map occupancy_of(const LidarScan& scan) {
  Map map = measurement_map(occupancy_type(Policy::kExclusive), scan.stamp_ns);
  CellGrid grid(map, 0, kLidarStep);
  const double cell_m = grid.cell_m();
  const Point origin = in_cells(scan.origin, cell_m);
  for (const auto& beam : scan.beams) {
    traverse(origin, in_cells(beam.end, cell_m), [&](std::int64_t i, std::int64_t j, bool last) {
      if (last) return;  // a hit, or on the border of what was seen
      const double range_m = cell_m * length(centre_of(i, j) - origin);
      grid.at(1, i, j) = static_cast<float>(kFreeMass * std::max(0.0, 1 - range_m / scan.max_range_m));
    });
  }
  for (const auto& beam : scan.beams) {
    if (!beam.obstacle) continue;
    const Point end = in_cells(beam.end, cell_m);
    const auto i = static_cast<std::int64_t>(std::floor(end.x_m));
    const auto j = static_cast<std::int64_t>(std::floor(end.y_m));
    float& occupied = grid.at(0, i, j);
    occupied = std::max(occupied, hit_mass(cell_m * (end - centre_of(i, j))));
    grid.at(1, i, j) = 0;
  }
  map.prune();
  stamp_layers(map, scan.stamp_ns);
  return map;
}

Map semantics_of(const CameraFrame& frame) {
  Map map = measurement_map(semantic_type(), frame.stamp_ns);
  CellGrid grid(map, 0, kCameraStep);
  // First the pixels of each class are counted in the planes, then the counts become masses.
  for (const auto& pixel : frame.pixels) {
    const Point p = in_cells(pixel.ground, grid.cell_m());
    grid.at(static_cast<int>(pixel.label), static_cast<std::int64_t>(std::floor(p.x_m)),
            static_cast<std::int64_t>(std::floor(p.y_m))) += 1;
  }
  const double lambda = -portable::log(1 - kPixelRelevance);
  for (const auto& [key, patch] : map.by_key()) {
    Layer& layer = map.layer(patch.index, 0, kCameraStep);
    for (std::size_t k = 0; k < layer.cells(); ++k) {
      const double pixels = static_cast<double>(layer.plane(0)[k] + layer.plane(1)[k] + layer.plane(2)[k]);
      if (pixels == 0) continue;
      const double known = -portable::expm1(-lambda * pixels);
      for (int c = 0; c < 3; ++c) {
        layer.plane(c)[k] = static_cast<float>(static_cast<double>(layer.plane(c)[k]) / pixels * known);
      }
      layer.plane(3)[k] = static_cast<float>(1 - known);
    }
  }
  stamp_layers(map, frame.stamp_ns);
  return map;
}

void TimeFusion::age(float alpha) {
  for (const auto& [key, patch] : map_.by_key()) {
    for (auto& [type, layer] : map_.patch(patch.index).layers) {
      discount(layer, map_.header().types[type], alpha);
    }
  }
}

void TimeFusion::add(const Map& measurement) {
  for (const auto& [key, patch] : measurement.by_key()) {
    for (const auto& [id, layer] : patch.layers) {
      const TypeId own = map_.header().types.find(measurement.header().types[id].name).value();
      const LayerType& type = map_.header().types[own];
      Layer& mine = map_.layer(patch.index, own, layer.step());
      const Layer* const both[] = {&mine, &layer};
      combine(both, type, Rule::kDempster, mine);
      mine.stamp_ns = std::max(mine.stamp_ns, layer.stamp_ns);
    }
  }
}

DriveMaps map_drive(const Scene& scene, const Drive& drive, const std::string& name, std::uint64_t seed) {
  Random random(seed);
  const LayerType occupancy = occupancy_type(Policy::kConditional);
  TimeFusion vehicle(
      drive_header({occupancy, semantic_type()}, name, "front-left and rear-right lidar, camera"));
  TimeFusion front(drive_header({occupancy}, name, "front-left lidar"));
  TimeFusion rear(drive_header({occupancy}, name, "rear-right lidar"));
  TimeFusion first(drive_header({occupancy_type(Policy::kExclusive)}, name, "front-left lidar, one scan"));
  const Lidar lidars[] = {front_left_lidar(), rear_right_lidar()};
  std::int64_t stamp_ns = drive.start_ns;
  for (const Pose& pose : drive.poses) {
    for (TimeFusion* fusion : {&vehicle, &front, &rear}) fusion->age(kAgeing);
    for (int which = 0; which < 2; ++which) {
      LidarScan scan = measure(scene, pose, lidars[which], random);
      scan.stamp_ns = stamp_ns;
      const Map cells = occupancy_of(scan);
      vehicle.add(cells);
      (which == 0 ? front : rear).add(cells);
      if (first.map().size() == 0) first.add(cells);
    }
    CameraFrame image = measure(scene, pose, Camera{}, random);
    image.stamp_ns = stamp_ns;
    vehicle.add(semantics_of(image));
    stamp_ns += drive.period_ns;
  }
  return {vehicle.map(), front.map(), rear.map(), first.map()};
}

Map truth_map(const Scene& scene) {
  Map map(drive_header({occupancy_type(Policy::kConditional), semantic_type()}, "none", "exact geometry"));
  const TypeTable& types = map.header().types;
  CellGrid occupancy(map, types.find(kOccupancy).value(), kLidarStep);
  for_each_cell(occupancy.cell_m(), [&](std::int64_t i, std::int64_t j, Point p) {
    if (!scene.hidden(p)) occupancy.at(scene.occupied(p) ? 0 : 1, i, j) = kTrueMass;
  });
  CellGrid semantics(map, types.find(kSemantics).value(), kCameraStep);
  for_each_cell(semantics.cell_m(), [&](std::int64_t i, std::int64_t j, Point p) {
    if (scene.hidden(p)) return;
    semantics.at(static_cast<int>(scene.ground(p)), i, j) = kTrueMass;
    semantics.at(3, i, j) = 1 - kTrueMass;
  });
  return map;
}

}  // namespace apgm::samples
