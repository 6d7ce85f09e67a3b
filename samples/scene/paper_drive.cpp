#include "scene/paper_drive.hpp"

#include <algorithm>

#include "scene/sensors.hpp"
#include "scene/town.hpp"

namespace apgm::samples {
namespace {

/// Two lidars that see all round together, as far as the models say.
Lidar road_lidar(Lidar lidar, const Models& models) {
  lidar.beams = 540;
  lidar.max_range_m = models.limits.max_range_m;
  lidar.clears_m = models.limits.no_return_clears_m;
  return lidar;
}

Camera road_camera(const Models& models) {
  return {.max_range_m = models.camera.max_range_m, .columns = 160, .rows = 160};
}

bool wants(const Profile& profile, const std::string& layer) {
  return std::any_of(profile.requirements.begin(), profile.requirements.end(),
                     [&](const Requirement& r) { return r.layer == layer; });
}

/// Cells of `layer` that hold data: a mass that is not 0, or less than 1 on Omega.
std::uint64_t known_cells(const Layer& layer, const LayerType& type) {
  std::uint64_t known = 0;
  if (type.stores_omega()) {
    for (const float omega : layer.plane(layer.channels() - 1)) known += omega < 1;
    return known;
  }
  const auto occupied = layer.plane(0);
  const auto free = layer.plane(1);
  for (std::size_t k = 0; k < layer.cells(); ++k) known += occupied[k] + free[k] > 0;
  return known;
}

void count_cells(const Map& map, TypeId type, DriveStep::OfLayer& out) {
  for (const auto& [key, patch] : map.by_key()) {
    const auto it = patch.layers.find(type);
    if (it == patch.layers.end()) continue;
    out.cells += it->second.cells();
    out.bytes += it->second.value_bytes();
    out.known += known_cells(it->second, map.header().types[type]);
  }
}

void add_times(const MapperReport& report, TypeId type, DriveStep::OfLayer& out) {
  out.observe_s += report.types[type].observe_s;
  out.fuse_s += report.types[type].fuse_s;
}

class PaperDrive {
 public:
  PaperDrive(std::uint64_t seed, const Models& models, const Schedule& schedule)
      : seed_(seed),
        models_(models),
        schedule_(schedule),
        scene_(town_scene(seed)),
        lidars_{road_lidar(front_left_lidar(), models), road_lidar(rear_right_lidar(), models)},
        camera_(road_camera(models)),
        mapper_(sample_frame(), models, {.ageing_per_s = 0.98}),
        occupancy_(mapper_.map().header().types.find(models.occupancy_layer).value()),
        semantics_(mapper_.map().header().types.find(models.semantic_layer).value()) {}

  DriveStep step(const Drive& drive, std::size_t k) {
    const VehiclePose& pose = drive.poses[k];
    const std::int64_t stamp_ns = drive.stamp_ns(k);
    DriveStep step;
    step.time_s = static_cast<double>(stamp_ns - drive.start_ns) / 1e9;
    step.vehicle = scene_.in_map(pose.position);
    const Profile& profile = schedule_.at(step.time_s);
    step.profile = profile.name;
    if (&profile != profile_) mapper_.set_profile(profile);
    profile_ = &profile;
    // Every step has noise of its own, so that a part of the drive is the same part of the whole.
    Random random(seed_ * 100'000 + k);
    const MapperReport moved = mapper_.move_to(step.vehicle, stamp_ns);
    step.occupancy.upkeep_s = moved.types[occupancy_].fuse_s;
    step.semantics.upkeep_s = moved.types[semantics_].fuse_s;
    for (const Lidar& lidar : lidars_) {
      const RangeScan scan = measure(scene_, pose, lidar, stamp_ns, random);
      add_times(mapper_.add(scan), occupancy_, step.occupancy);
    }
    if (wants(profile, models_.semantic_layer)) {
      const LabelledGround image = measure(scene_, pose, camera_, stamp_ns, random);
      add_times(mapper_.add(image), semantics_, step.semantics);
    }
    step.patches = mapper_.map().size();
    count_cells(mapper_.map(), occupancy_, step.occupancy);
    count_cells(mapper_.map(), semantics_, step.semantics);
    return step;
  }

  const Map& map() const { return mapper_.map(); }

 private:
  std::uint64_t seed_;
  const Models& models_;
  const Schedule& schedule_;
  Scene scene_;
  Lidar lidars_[2];
  Camera camera_;
  Mapper mapper_;
  TypeId occupancy_, semantics_;
  const Profile* profile_ = nullptr;
};

}  // namespace

Map run_paper_drive(const PaperDriveOptions& options, const Models& models, const Schedule& schedule,
                    const std::function<void(const DriveStep&, const Map&)>& on_step) {
  const Drive drive = town_drive();
  PaperDrive run(options.seed, models, schedule);
  for (const auto& entry : schedule.entries) entry.profile.check(sample_frame(), run.map().header().types);
  const auto steps = [&](double seconds) {
    return static_cast<std::size_t>(std::max(0.0, seconds) * 1e9 / static_cast<double>(drive.period_ns) +
                                    0.5);
  };
  const std::size_t first = steps(options.from_s);
  const std::size_t count = steps(options.seconds);
  for (std::size_t k = first; k < std::min(drive.poses.size(), first + count); ++k) {
    on_step(run.step(drive, k), run.map());
  }
  return run.map();
}

}  // namespace apgm::samples
