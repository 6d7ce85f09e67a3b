#include <cmath>
#include <cstdlib>

#include "apgm/core/error.hpp"
#include "apgm/observe/model.hpp"
#include "observe/observed_layers.hpp"
#include "observe/occupancy_models.hpp"
#include "observe/segment_walk.hpp"

namespace apgm {

using observe::GridPoint;
using observe::ObservedLayers;

struct Observer::State {
  State(const Frame& f, Models m, std::uint64_t max_bytes)
      : frame(f),
        models(std::move(m)),
        occupancy(models.occupancy_type(), max_bytes),
        semantics(models.semantic_type(), max_bytes),
        finish_richter(models.richter),
        cells(observe::SegmentWalk::kMaxCells) {}

  /// A return, once all beams have crossed their cells.
  struct Hit {
    int layer;
    CellIndex cell;
    float relevance;
  };

  GridPoint checked_origin(Point origin) const;
  void add_beam(const RangeScan::Beam& beam, const StepOf& step_of);
  void cross(ObservedLayer& layer, std::span<const CellIndex> run) const;
  void add_return(const GridPoint& at, int layer, CellIndex cell);
  void apply_hits();
  void finish_occupancy(const GridPoint& origin);
  void add_pixel(const LabelledGround::Pixel& pixel, Point origin, const StepOf& step_of);

  Frame frame;
  Models models;
  Skipped skipped;
  ObservedLayers occupancy;
  ObservedLayers semantics;
  observe::RichterFinish finish_richter;
  std::vector<CellIndex> cells;
  std::vector<Hit> hits;
};

GridPoint Observer::State::checked_origin(Point origin) const {
  if (!observe::is_finite(origin)) {
    throw Error(ErrorCode::kInvalidArgument, "the position of a sensor is not a finite number");
  }
  const auto point = observe::grid_point(frame, origin);
  if (!point) throw Error(ErrorCode::kLimit, "the position of a sensor lies outside all patch indices");
  return *point;
}

void Observer::State::add_beam(const RangeScan::Beam& beam, const StepOf& step_of) {
  if (!observe::is_finite(beam.from) || !observe::is_finite(beam.to)) {
    ++skipped.not_a_number;
    return;
  }
  const auto from = observe::grid_point(frame, beam.from), to = observe::grid_point(frame, beam.to);
  constexpr std::int64_t kMax = observe::SegmentWalk::kMaxLength_nm;
  if (!from || !to || std::abs(to->x - from->x) > kMax || std::abs(to->y - from->y) > kMax) {
    ++skipped.outside;
    return;
  }
  observe::SegmentWalk walk(*from, *to, observe::edge_nm(frame));
  for (bool last = false; !last;) {
    last = walk.in_last_patch();
    const int at = occupancy.find(walk.patch(), step_of);
    const bool wanted = at != ObservedLayers::kUnwanted;
    const auto run = walk.cross(wanted ? occupancy[at].cells.step() : 0, cells.data());
    if (!wanted) continue;
    // The cell a beam ends in is not crossed.
    cross(occupancy[at], last ? run.first(run.size() - 1) : run);
    if (last && beam.hit) add_return(*to, at, run.back());
  }
}

void Observer::State::cross(ObservedLayer& layer, std::span<const CellIndex> run) const {
  if (run.empty()) return;
  observe::touch(layer.rows, run.front().b);
  observe::touch(layer.rows, run.back().b);
  float* const plane = layer.cells.plane(1).data();
  const int step = layer.cells.step();
  if (models.kind == ModelKind::kNuss) {
    for (const CellIndex c : run) plane[(c.b << step) + c.a] = observe::kCrossed;
  } else {
    for (const CellIndex c : run) plane[(c.b << step) + c.a] += 1.0f;
  }
}

void Observer::State::add_return(const GridPoint& at, int layer, CellIndex cell) {
  ObservedLayer& l = occupancy[layer];
  observe::touch(l.rows, cell.b);
  float relevance = 0;
  if (models.kind == ModelKind::kNuss) {
    relevance = static_cast<float>(observe::nuss_relevance(
        models.nuss, observe::within_patch(at, l.patch, frame), cell, frame.cell_m(l.cells.step())));
  }
  hits.push_back({layer, cell, relevance});
}

void Observer::State::apply_hits() {
  for (const Hit& hit : hits) {
    Layer& layer = occupancy[hit.layer].cells;
    float& occupied = layer.at(0, hit.cell);
    if (models.kind == ModelKind::kNuss) {
      occupied = std::min(occupied + hit.relevance * (1.0f - occupied), observe::kMostMass);
      layer.at(1, hit.cell) = observe::kHit;
    } else {
      occupied += 1.0f;
    }
  }
}

void Observer::State::finish_occupancy(const GridPoint& origin) {
  for (ObservedLayer& layer : occupancy) {
    if (models.kind == ModelKind::kNuss) {
      observe::finish_nuss(models.nuss, observe::within_patch(origin, layer.patch, frame),
                           frame.cell_m(layer.cells.step()), layer);
    } else {
      finish_richter(layer);
    }
  }
}

void Observer::State::add_pixel(const LabelledGround::Pixel& pixel, Point origin, const StepOf& step_of) {
  if (!observe::is_finite(pixel.ground)) {
    ++skipped.not_a_number;
    return;
  }
  const auto point = observe::grid_point(frame, pixel.ground);
  if (!point || pixel.label >= models.classes.size()) {
    ++skipped.outside;
    return;
  }
  const double dx = pixel.ground.x_m - origin.x_m, dy = pixel.ground.y_m - origin.y_m;
  if (!(dx * dx + dy * dy < models.camera.max_range_m * models.camera.max_range_m)) {
    ++skipped.no_return;
    return;
  }
  const PatchIndex patch = frame.patch_at(pixel.ground);
  const int at = semantics.find(patch, step_of);
  if (at == ObservedLayers::kUnwanted) return;
  ObservedLayer& layer = semantics[at];
  const CellIndex cell = frame.cell_at(pixel.ground, layer.cells.step()).cell;
  observe::touch(layer.rows, cell.b);
  layer.cells.at(pixel.label, cell) += 1.0f;
}

Observer::Observer(const Frame& frame, Models models, std::uint64_t max_bytes) {
  frame.check();
  models.check();
  state_ = std::make_unique<State>(frame, std::move(models), max_bytes);
}
Observer::~Observer() = default;
Observer::Observer(Observer&&) noexcept = default;
Observer& Observer::operator=(Observer&&) noexcept = default;

const Models& Observer::models() const { return state_->models; }

const Skipped& Observer::skipped() const { return state_->skipped; }

void Observer::trim(std::uint64_t most_bytes) {
  state_->occupancy.trim(most_bytes / 2);
  state_->semantics.trim(most_bytes / 2);
}

std::span<const ObservedLayer> Observer::observe(const RangeScan& scan, const StepOf& step_of) {
  State& s = *state_;
  const GridPoint origin = s.checked_origin(scan.origin);
  s.occupancy.begin_measurement();
  s.hits.clear();
  for (const RangeScan::Beam& beam : scan.beams) s.add_beam(beam, step_of);
  s.occupancy.check_size();
  s.apply_hits();
  s.finish_occupancy(origin);
  return s.occupancy.finish(scan.stamp_ns);
}

std::span<const ObservedLayer> Observer::observe(const LabelledGround& image, const StepOf& step_of) {
  State& s = *state_;
  s.checked_origin(image.origin);
  s.semantics.begin_measurement();
  for (const LabelledGround::Pixel& pixel : image.pixels) s.add_pixel(pixel, image.origin, step_of);
  s.semantics.check_size();
  for (ObservedLayer& layer : s.semantics) observe::finish_camera(s.models.camera, layer);
  return s.semantics.finish(image.stamp_ns);
}

}  // namespace apgm
