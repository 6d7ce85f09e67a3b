#include "apgm/observe/mapper.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "apgm/core/error.hpp"
#include "apgm/fuse/framework.hpp"
#include "apgm/fuse/resample.hpp"
#include "fuse/combine_blocks.hpp"
#include "observe/mapper_state.hpp"

namespace apgm {
namespace {

[[noreturn]] void refuse(const std::string& what) { throw Error(ErrorCode::kInvalidArgument, what); }

const MapperOptions& checked(const MapperOptions& options, const PatchStore* store) {
  if (!(options.ageing_per_s > 0 && options.ageing_per_s <= 1)) {
    refuse("the share of evidence left after a second lies above 0, and is at most 1");
  }
  if (!(options.min_unknown >= 0 && options.min_unknown <= 0.5)) {
    refuse("the least unknown mass lies in 0 .. 0.5");
  }
  if (options.max_memory_bytes > 0 && store == nullptr) {
    refuse("a bound on the memory of a mapper needs a store");
  }
  return options;
}

/// Values that one measurement may fill: unless it is said, room for one layer of any size at least.
std::uint64_t measurement_bytes(const MapperOptions& options) {
  if (options.max_measurement_bytes > 0) {
    return std::min(options.max_measurement_bytes, Observer::kMaxBytes);
  }
  if (options.max_memory_bytes == 0) return Observer::kMaxBytes;
  return std::clamp<std::uint64_t>(options.max_memory_bytes, Layer::kMaxBytes, Observer::kMaxBytes);
}

/// Memory of measurements that is kept from call to call.
std::uint64_t kept_bytes(const MapperOptions& options) {
  constexpr std::uint64_t kMost = std::uint64_t{64} << 20;
  return options.max_memory_bytes == 0 ? kMost : std::min(kMost, options.max_memory_bytes / 4);
}

/// Memory of layers that left: with a bound they leave all the time, and must not take more than those that
/// stay.
std::uint64_t spare_bytes(const MapperOptions& options) {
  constexpr std::uint64_t kMost = fuse::SpareLayers::kMostBytes;
  return options.max_memory_bytes == 0 ? kMost : std::min(kMost, options.max_memory_bytes / 8);
}

/// A fused map holds both kinds of evidence in a cell.
LayerType fused(LayerType type) {
  if (type.policy == Policy::kExclusive) type.policy = Policy::kConditional;
  return type;
}

MapHeader header_of(const Frame& frame, const Models& models) {
  MapHeader header;
  header.frame = frame;
  header.types = TypeTable({fused(models.occupancy_type()), models.semantic_type()});
  return header;
}

/// `rows` of `in` in `out`, discounted. The other rows of `out` hold unspecified values.
void discount_rows(const Layer& in, const LayerType& type, RowRange rows, float alpha, Layer& out) {
  out.reshape(in.channels(), in.step());
  out.stamp_ns = in.stamp_ns;
  const auto side = static_cast<std::size_t>(in.side());
  const std::size_t first = static_cast<std::size_t>(rows.begin) * side;
  const std::size_t cells = static_cast<std::size_t>(rows.end - rows.begin) * side;
  for (int c = 0; c < in.channels(); ++c) {
    std::ranges::copy(in.plane(c).subspan(first, cells), out.plane(c).begin() + static_cast<long>(first));
  }
  fuse::discount_cells(fuse::cells_of(out, first), type, alpha, cells);
}

}  // namespace

Mapper::State::State(const Frame& map_frame, const Models& models, const MapperOptions& mapper_options,
                     PatchStore* patch_store)
    : frame(map_frame),
      options(checked(mapper_options, patch_store)),
      store(patch_store),
      observer(map_frame, models, measurement_bytes(options)),
      occupancy_type(models.occupancy_type()),
      semantic_type(models.semantic_type()),
      ageing(options.ageing_per_s),
      live(header_of(map_frame, models), spare_bytes(options)),
      base_step(map_frame.step_for(options.cell_m)) {
  set_types(live.types());
}

/// What depends on the ids of types.
void Mapper::State::set_types(const TypeTable& types) {
  if (store != nullptr) store->set_types(types);
  const std::vector<TypeId> ids = matching_ids(live.types(), types);
  live.set_types(types);
  for (auto& [key, patch] : resting) {
    for (TypeId& id : patch.types) id = ids[id];
  }
  occupancy = *types.find(occupancy_type.name);
  semantics = *types.find(semantic_type.name);
  steps.assign(types.size(), {});
}

void Mapper::State::add_types(const TypeTable& types) {
  const std::array<const TypeTable*, 2> tables{&live.types(), &types};
  const TypeTable joined = fused_types(tables);
  std::vector<LayerType> all;
  for (const LayerType& type : joined) all.push_back(fused(type));
  if (TypeTable table(std::move(all)); table != live.types()) set_types(table);
}

void Mapper::State::begin_call(std::optional<std::int64_t> stamp_ns) {
  ++calls;
  report = {};
  report.types.resize(live.types().size());
  if (stamp_ns) advance(*stamp_ns);
  follow();
}

MapperReport Mapper::State::end_call() {
  evict();
  report.patches = live.map().size();
  const std::vector<MapperReport::OfType>& totals = live.totals();
  for (std::size_t t = 0; t < totals.size(); ++t) {
    report.types[t].layers = totals[t].layers;
    report.types[t].cells = totals[t].cells;
    report.types[t].bytes = totals[t].bytes;
  }
  return std::move(report);
}

/// Before anything of a measurement is looked at.
void Mapper::State::check_ready(float alpha) const {
  if (!(alpha >= 0 && alpha <= 1)) refuse("the trust in a measurement lies between 0 and 1");
  if (profile && !vehicle) {
    throw Error(ErrorCode::kInvalidArgument, "with a profile a mapper must know where the vehicle is")
        .hint("call move_to before the first measurement");
  }
}

/// The measured cells at `step`, discounted; `rows` then are those that may hold data.
const Layer& Mapper::State::prepared(const Measured& measured, int step, RowRange& rows) {
  const Layer* cells = measured.cells;
  if (cells->step() != step) {
    resample(*cells, *measured.cells_type, step, resampled);
    cells = &resampled;
    rows = {0, resampled.side()};
  }
  if (measured.alpha < 1) {
    discount_rows(*cells, *measured.cells_type, rows, measured.alpha, trusted);
    cells = &trusted;
  }
  return *cells;
}

void Mapper::State::fuse(const Measured& measured) {
  if (!profile) bring_back(measured.patch);
  const LayerType& type = live.types()[measured.type];
  Layer* layer = live.find(measured.patch, measured.type);
  int step = std::max(measured.cells->step(), layer != nullptr ? layer->step() : 0);
  if (profile) {
    const auto wanted = required(measured.patch, measured.type);
    if (!wanted) return;
    step = *wanted;
  }
  check_room(layer_bytes(measured.type, step) - (layer != nullptr ? layer->value_bytes() : 0));
  RowRange rows = measured.rows;
  const Layer& cells = prepared(measured, step, rows);
  if (layer != nullptr && layer->step() != step) {
    live.resample(measured.patch, measured.type, step);
    ++report.layers_resampled;
    floor_unknown(measured.patch, measured.type);
  }
  std::uint64_t conflicts = 0;
  if (layer == nullptr) {
    layer = &live.insert(measured.patch, measured.type, step);
    const std::array<const Layer*, 1> one{&cells};
    combine_rows(one, type, options.rule, *layer, rows);
  } else {
    const std::array<const Layer*, 2> both{layer, &cells};
    conflicts = combine_rows(both, type, options.rule, *layer, rows).total_conflicts;
    live.mark(measured.patch, measured.type);
  }
  observe::keep_unknown(*layer, type, rows, static_cast<float>(options.min_unknown));
  live.touch(measured.patch, calls);
  report.total_conflicts += conflicts;
  report.types[measured.type].cells_fused += static_cast<std::uint64_t>(rows.end - rows.begin)
                                             << layer->step();
  // By total conflict, which some rules turn into m(Omega), by a trust near 0, or by rounding of masses near
  // 0.
  if (is_vacuous(*layer, type)) live.drop(measured.patch, measured.type);
  evict(measured.patch);
}

template <typename Measurement>
MapperReport Mapper::State::observe(const Measurement& measurement, TypeId type, const LayerType& cells_type,
                                    float alpha) {
  check_ready(alpha);
  begin_call(measurement.stamp_ns);
  if (alpha == 0) return end_call();
  // Whatever happens, the memory of this measurement is not kept beyond the call.
  struct Trim {
    ~Trim() { observer.trim(most_bytes); }
    Observer& observer;
    std::uint64_t most_bytes;
  } const trim{observer, kept_bytes(options)};
  std::span<const ObservedLayer> layers;
  {
    const Stopwatch watch(report.types[type].observe_s);
    layers = observer.observe(measurement, [&](PatchIndex patch) {
      return profile ? required(patch, type) : std::optional<int>(base_step);
    });
  }
  {
    const Stopwatch watch(report.types[type].fuse_s);
    for (const ObservedLayer& layer : layers) {
      fuse({layer.patch, type, &layer.cells, &cells_type, layer.rows, alpha});
    }
  }
  return end_call();
}

Mapper::Mapper(const Frame& frame, const Models& models, const MapperOptions& options, PatchStore* store)
    : state_(std::make_unique<State>(frame, models, options, store)) {}
Mapper::~Mapper() = default;
Mapper::Mapper(Mapper&&) noexcept = default;
Mapper& Mapper::operator=(Mapper&&) noexcept = default;

void Mapper::set_profile(std::optional<Profile> profile) {
  State& s = *state_;
  std::optional<ProfileInFrame> in_frame;
  if (profile) {
    profile->check(s.frame, s.live.types());
    in_frame.emplace(*profile, s.frame);
  }
  s.profile = std::move(in_frame);
  s.profile_name = profile ? std::move(profile->name) : std::string();
  s.follows = false;
}

MapperReport Mapper::move_to(Point vehicle, std::int64_t stamp_ns) {
  State& s = *state_;
  s.frame.patch_at(vehicle);  // a position that cannot be used is refused before anything happens
  if (s.vehicle != vehicle) s.follows = false;
  s.vehicle = vehicle;
  s.begin_call(stamp_ns);
  return s.end_call();
}

MapperReport Mapper::add(const RangeScan& scan, float alpha) {
  return state_->observe(scan, state_->occupancy, state_->occupancy_type, alpha);
}

MapperReport Mapper::add(const LabelledGround& image, float alpha) {
  return state_->observe(image, state_->semantics, state_->semantic_type, alpha);
}

MapperReport Mapper::add(const PatchSource& measurement, float alpha) {
  State& s = *state_;
  s.check_ready(alpha);
  const MapHeader& header = measurement.header();
  if (header.frame != s.frame) {
    throw Error(ErrorCode::kIncompatible, "the frames of the map and the measurement differ")
        .hint("regrid the measurement first");
  }
  s.add_types(header.types);
  s.begin_call(header.stamp_ns != 0 ? std::optional(header.stamp_ns) : std::nullopt);
  if (alpha == 0) return s.end_call();
  const auto cursor = measurement.patches();
  PatchInfo patch;
  Layer cells;
  while (cursor->next(patch)) {
    for (const LayerInfo& info : patch.layers) {
      const LayerType& cells_type = header.types[info.type];
      const TypeId type = *s.live.types().find(cells_type.name);
      measurement.load(info, cells);
      const State::Stopwatch watch(s.report.types[type].fuse_s);
      canonicalise(cells, cells_type);
      if (is_vacuous(cells, cells_type)) continue;
      s.fuse({info.patch, type, &cells, &cells_type, {0, cells.side()}, alpha});
    }
  }
  return s.end_call();
}

const Map& Mapper::map() const { return state_->live.map(); }

MapChanges Mapper::take_changes() { return state_->live.take_changes(); }

void Mapper::flush() {
  if (state_->store == nullptr) refuse("a mapper without a store cannot be flushed");
  state_->flush();
}

const Skipped& Mapper::skipped() const { return state_->observer.skipped(); }

}  // namespace apgm
