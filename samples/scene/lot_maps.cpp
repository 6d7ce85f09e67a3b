#include "scene/lot_maps.hpp"

#include <utility>

#include "apgm/observe/mapper.hpp"
#include "scene/sensors.hpp"

namespace apgm::samples {
namespace {

constexpr double kLidarCell_m = 0.1;
constexpr double kCameraCell_m = 0.2;
constexpr float kTrueMass = 0.98f;

MapHeader header_of(std::vector<LayerType> types, const std::string& name, const std::string& sensors) {
  MapHeader header;
  header.frame = sample_frame();
  header.types = TypeTable(std::move(types));
  header.metadata = {{"sample.vehicle", name}, {"sample.sensors", sensors}};
  return header;
}

/// All of the scene, wherever the vehicle is.
Profile whole_scene(const Scene& scene, const Models& models) {
  const Point low = scene.in_map(scene.bounds().min);
  const Point high = scene.in_map(scene.bounds().max);
  const Polygon all{{{low, {high.x_m, low.y_m}, high, {low.x_m, high.y_m}}}};
  return {"scene",
          {{models.occupancy_layer, kLidarCell_m, all}, {models.semantic_layer, kCameraCell_m, all}}};
}

/// The map of a sensor or vehicle, without the types that its sensors cannot tell of.
Map labelled(const Map& map, std::vector<LayerType> types, const std::string& name,
             const std::string& sensors) {
  Map out(header_of(std::move(types), name, sensors));
  for (const auto& [key, patch] : map.by_key()) {
    for (const auto& [id, layer] : patch.layers) {
      const auto type = out.header().types.find(map.header().types[id].name);
      if (type) out.patch(patch.index).layers[*type] = layer;
    }
  }
  return out;
}

Map first_scan_map(const RangeScan& scan, const Models& models, const std::string& name) {
  const LayerType type = models.occupancy_type();
  Map map(header_of({type}, name, scan.source + ", one scan"));
  const int step = map.header().frame.step_for(kLidarCell_m);
  Observer observer(map.header().frame, models);
  for (const auto& observed : observer.observe(scan, [&](PatchIndex) { return step; })) {
    map.patch(observed.patch).layers[0] = observed.cells;
  }
  return map;
}

/// Visits the cells of `patch` whose centres lie in the scene: visit(cell, centre in scene metres).
template <class Visit>
void for_each_cell(const Scene& scene, const Frame& frame, PatchIndex patch, int step, Visit visit) {
  const Point corner = scene.from_map(frame.origin_m(patch));
  const double cell_m = frame.cell_m(step);
  for (int b = 0; b < 1 << step; ++b) {
    for (int a = 0; a < 1 << step; ++a) {
      const Point centre = corner + cell_m * Point{a + 0.5, b + 0.5};
      if (contains(scene.bounds(), centre) && !scene.hidden(centre)) visit(CellIndex{a, b}, centre);
    }
  }
}

}  // namespace

Models lot_models() {
  Models models;
  models.nuss.free_max = 0.5;
  models.nuss.free_range_m = 60;
  models.camera.max_range_m = 25;
  return models;
}

DriveMaps map_drive(const Scene& scene, const Drive& drive, const std::string& name, std::uint64_t seed) {
  Random random(seed);
  const Models models = lot_models();
  const LayerType occupancy = LayerType::occupancy(models.occupancy_layer, Policy::kConditional);
  MapperOptions options;
  options.ageing_per_s = 0.97;
  Mapper vehicle(sample_frame(), models, options);
  Mapper front(sample_frame(), models, options);
  Mapper rear(sample_frame(), models, options);
  for (Mapper* mapper : {&vehicle, &front, &rear}) mapper->set_profile(whole_scene(scene, models));
  Map first_scan(header_of({}, name, ""));
  const Lidar lidars[] = {front_left_lidar(), rear_right_lidar()};
  for (std::size_t k = 0; k < drive.poses.size(); ++k) {
    const VehiclePose& pose = drive.poses[k];
    const std::int64_t stamp_ns = drive.stamp_ns(k);
    for (Mapper* mapper : {&vehicle, &front, &rear}) mapper->move_to(scene.in_map(pose.position), stamp_ns);
    for (int which = 0; which < 2; ++which) {
      const RangeScan scan = measure(scene, pose, lidars[which], stamp_ns, random);
      if (k == 0 && which == 0) first_scan = first_scan_map(scan, models, name);
      vehicle.add(scan);
      (which == 0 ? front : rear).add(scan);
    }
    vehicle.add(measure(scene, pose, Camera{}, stamp_ns, random));
  }
  return {labelled(vehicle.map(), {occupancy, models.semantic_type()}, name,
                   lidars[0].name + ", " + lidars[1].name + ", camera"),
          labelled(front.map(), {occupancy}, name, lidars[0].name),
          labelled(rear.map(), {occupancy}, name, lidars[1].name), std::move(first_scan)};
}

Map truth_map(const Scene& scene) {
  const Models models = lot_models();
  Map map(header_of({LayerType::occupancy(models.occupancy_layer), models.semantic_type()}, "none",
                    "exact geometry"));
  const Frame& frame = map.header().frame;
  const TypeId occupancy = map.header().types.find(models.occupancy_layer).value();
  const TypeId semantics = map.header().types.find(models.semantic_layer).value();
  const int fine = frame.step_for(kLidarCell_m);
  const int coarse = frame.step_for(kCameraCell_m);
  const PatchRange range =
      frame.patches_meeting({scene.in_map(scene.bounds().min), scene.in_map(scene.bounds().max)});
  for (PatchIndex at = range.min; at.y <= range.max.y; ++at.y) {
    for (at.x = range.min.x; at.x <= range.max.x; ++at.x) {
      Layer& cells = map.layer(at, occupancy, fine);
      for_each_cell(scene, frame, at, fine, [&](CellIndex cell, Point centre) {
        cells.at(scene.occupied(centre) ? 0 : 1, cell) = kTrueMass;
      });
      Layer& labels = map.layer(at, semantics, coarse);
      for_each_cell(scene, frame, at, coarse, [&](CellIndex cell, Point centre) {
        labels.at(static_cast<int>(scene.ground(centre)), cell) = kTrueMass;
        labels.at(3, cell) = 1 - kTrueMass;
      });
    }
  }
  map.prune();
  return map;
}

}  // namespace apgm::samples
