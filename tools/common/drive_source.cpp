#include "tools/common/drive_source.hpp"

#include <algorithm>
#include <optional>

#include "apgm/core/budget.hpp"
#include "apgm/core/error.hpp"
#include "converters/scans/pose_file.hpp"
#include "tools/common/scan_mapping.hpp"
#include "tools/common/scan_memory.hpp"

namespace apgm::tools {
namespace {

constexpr double kKittiPeriod_s = 0.1;
constexpr float kSeenFree = 0.5f;

/// Part of what is left that the cells of one measurement may take.
constexpr std::uint64_t kMeasurementShare = 4;

MapperOptions mapper_options(const DriveRequest& request) {
  MapperOptions options;
  if (request.memory_left) {
    options.max_measurement_bytes = std::max<std::uint64_t>(request.memory_left() / kMeasurementShare, 1);
  }
  return options;
}

/// Checks that there is room for the layers that a profile asks for round the vehicle and the map has not,
/// and for a measurement beside them.
/// @param measurement_bytes  most that it may take
void check_room(const DriveRequest& request, const Profile& wanted, Point vehicle, const Map& map,
                std::uint64_t measurement_bytes) {
  if (!request.memory_left) return;
  const TypeTable& types = map.header().types;
  const ProfileInFrame profile(wanted, request.frame);
  const PatchRange reach = profile.reach(vehicle);
  std::uint64_t need = measurement_bytes;
  for (std::int32_t y = reach.min.y; y <= reach.max.y; ++y) {
    for (std::int32_t x = reach.min.x; x <= reach.max.x; ++x) {
      for (TypeId type = 0; type < types.size(); ++type) {
        const auto step = profile.required_step({x, y}, types[type].name, vehicle);
        if (!step) continue;
        const Layer* layer = map.find({x, y}, type);
        if (layer == nullptr || layer->step() != *step) need += layer_memory(types[type], *step);
      }
    }
  }
  check_budget(request.memory_left(), need,
               "the memory budget does not hold what profile '" + wanted.name + "' requires");
}

class ScanDrive final : public DriveSource {
 public:
  explicit ScanDrive(const DriveRequest& request)
      : request_(request),
        scans_(converters::open_scans(request.scans)),
        options_(mapper_options(request)),
        mapper_(request.frame, request.models, options_) {}

  bool next(DriveMoment& out) override {
    if (!scans_->next(measurement_)) return false;
    const std::int64_t stamp_ns = stamp_of(measurement_);
    if (measurements_++ == 0) first_ns_ = last_ns_ = stamp_ns;
    last_ns_ = std::max(last_ns_, stamp_ns);
    out.time_s = static_cast<double>(last_ns_ - first_ns_) / 1e9;
    const Profile& wanted = request_.schedule.at(out.time_s);
    out.vehicle = position_of(measurement_);
    check_room(request_, wanted, out.vehicle, mapper_.map(), options_.max_measurement_bytes);
    if (&wanted != profile_) mapper_.set_profile(wanted);
    profile_ = &wanted;
    out.profile = wanted.name;
    mapper_.move_to(out.vehicle, stamp_ns);
    add();
    return true;
  }

  const Map& map() override { return mapper_.map(); }
  std::uint64_t measurements() const override { return measurements_; }
  std::uint64_t bytes_done() const override { return scans_->bytes_done(); }
  std::uint64_t total_bytes() const override { return scans_->total_bytes(); }
  std::vector<std::string> faults() const override {
    std::vector<std::string> texts;
    for (const converters::ScanFault& fault : scans_->faults()) texts.push_back(fault.text);
    return texts;
  }

 private:
  void add() {
    try {
      add_measurement(mapper_, measurement_, request_.models.limits, skipped_, beams_);
    } catch (const Error& e) {
      const auto hint = budget_hint(e);
      if (!hint || !request_.memory_left) throw;
      throw over_budget(e.message(), (hint->least_mebibytes << 20) * kMeasurementShare);
    }
  }

  DriveRequest request_;
  std::unique_ptr<converters::ScanReader> scans_;
  MapperOptions options_;
  Mapper mapper_;
  converters::Measurement measurement_;
  const Profile* profile_ = nullptr;
  Skipped skipped_;
  std::uint64_t beams_ = 0, measurements_ = 0;
  std::int64_t first_ns_ = 0, last_ns_ = 0;
};

class MotionDrive final : public DriveSource {
 public:
  explicit MotionDrive(const DriveRequest& request)
      : request_(request),
        poses_(converters::read_poses(request.scans.paths.front(), faults_)),
        map_(header()) {
    if (poses_.kind == converters::PoseFile::Kind::kList) {
      throw Error(ErrorCode::kForeign, "'" + poses_.path + "' is a list of clouds, not of poses");
    }
  }

  bool next(DriveMoment& out) override {
    while (row_ < poses_.rows.size() && !poses_.rows[row_].pose) ++row_;
    if (row_ == poses_.rows.size()) return false;
    const auto& row = poses_.rows[row_];
    if (!first_ns_) first_ns_ = row.stamp_ns.value_or(0);
    out.time_s = row.stamp_ns ? static_cast<double>(*row.stamp_ns - *first_ns_) / 1e9
                              : kKittiPeriod_s * static_cast<double>(row_);
    out.vehicle = row.pose->position();
    profile_ = &request_.schedule.at(out.time_s);
    out.profile = profile_->name;
    vehicle_ = out.vehicle;
    is_current_ = false;
    ++row_;
    ++measurements_;
    return true;
  }

  /// Made when it is asked for: most poses are not looked at.
  const Map& map() override {
    if (is_current_) return map_;
    map_ = Map(header());
    check_room(request_, *profile_, vehicle_, map_, 0);
    const ProfileInFrame profile(*profile_, request_.frame);
    const PatchRange reach = profile.reach(vehicle_);
    for (std::int32_t y = reach.min.y; y <= reach.max.y; ++y) {
      for (std::int32_t x = reach.min.x; x <= reach.max.x; ++x) add_patch(profile, {x, y});
    }
    is_current_ = true;
    return map_;
  }

  std::uint64_t measurements() const override { return measurements_; }

 private:
  MapHeader header() const {
    MapHeader header;
    header.frame = request_.frame;
    header.types = TypeTable({request_.models.occupancy_type(), request_.models.semantic_type()});
    return header;
  }

  void add_patch(const ProfileInFrame& profile, PatchIndex index) {
    const TypeTable& types = map_.header().types;
    for (TypeId type = 0; type < types.size(); ++type) {
      const auto step = profile.required_step(index, types[type].name, vehicle_);
      if (!step) continue;
      Layer& layer = map_.layer(index, type, *step);
      // Free for occupancy, the first class for semantics: half of the mass, the rest is Omega.
      const int channel = types[type].is_occupancy() ? 1 : 0;
      std::ranges::fill(layer.plane(channel), kSeenFree);
      if (types[type].stores_omega()) std::ranges::fill(layer.plane(layer.channels() - 1), 1 - kSeenFree);
    }
  }

  DriveRequest request_;
  converters::ScanFaults faults_;
  converters::PoseFile poses_;
  Map map_;
  const Profile* profile_ = nullptr;
  Point vehicle_;
  bool is_current_ = false;
  std::size_t row_ = 0;
  std::uint64_t measurements_ = 0;
  std::optional<std::int64_t> first_ns_;
};

}  // namespace

void DriveRequest::check() const {
  const TypeTable types({models.occupancy_type(), models.semantic_type()});
  for (const Schedule::Entry& entry : schedule.entries) entry.profile.check(frame, types);
}

std::unique_ptr<DriveSource> open_drive(const DriveRequest& request) {
  return std::make_unique<ScanDrive>(request);
}

std::unique_ptr<DriveSource> open_motion(const DriveRequest& request) {
  return std::make_unique<MotionDrive>(request);
}

}  // namespace apgm::tools
