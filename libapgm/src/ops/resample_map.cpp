#include "apgm/ops/resample_map.hpp"

#include <algorithm>

#include "apgm/fuse/resample.hpp"
#include "pipeline.hpp"
#include "resample_loss.hpp"
#include "resample_state.hpp"

namespace apgm::ops {
namespace {

struct ResampleJob final : Job {
  PatchInfo info;
  std::vector<ResampledLayer> layers;
};

class Resample final : public Stream {
 public:
  Resample(const ResamplePlan::State& plan, PatchSink& sink,
           const std::function<void(const ResampledLayer&)>& watch)
      : plan_(plan), sink_(sink), watch_(watch), cursor_(plan.source->patches()) {
    report_.types.resize(plan.header.types.size());
  }

  std::unique_ptr<Job> make_job() const override { return std::make_unique<ResampleJob>(); }

  bool produce(Job& base) override {
    auto& job = static_cast<ResampleJob&>(base);
    if (!cursor_->next(job.info)) return false;
    job.patch = job.info.patch;
    job.layers.clear();
    for (const LayerInfo& layer : job.info.layers) {
      job.layers.push_back({job.patch, layer.type, layer.step, plan_.wanted(layer), {}, false});
    }
    return true;
  }

  void work(Job& base) const override {
    auto& job = static_cast<ResampleJob&>(base);
    for (std::size_t i = 0; i < job.layers.size(); ++i) {
      if (!job.layers[i].to) continue;
      const std::size_t before = job.parcels.used().size();
      bring(job.info.layers[i], job.layers[i], job);
      job.layers[i].emptied = job.parcels.used().size() == before;
    }
  }

  void consume(Job& base) override;
  ResampleReport report() && { return std::move(report_); }

 private:
  void bring(const LayerInfo& info, ResampledLayer& layer, ResampleJob& job) const {
    if (*layer.to == layer.from) {
      pass_layer(*plan_.source, info, info.type, sink_, sink_.takes_stored(), job);
      return;
    }
    const LayerType& type = plan_.header.types[info.type];
    if (job.desk.loaded.empty()) job.desk.loaded.resize(1);
    Layer& native = job.desk.loaded[0];
    plan_.source->load(info, native);
    resample(native, type, *layer.to, job.desk.scratch);
    layer.loss = measure_loss(native, type, job.desk.scratch);
    pack_scratch(info.type, info.stamp_ns, sink_, job);
  }

  void take(const ResampledLayer& layer);
  void take_regridded(ResampleJob& job);

  const ResamplePlan::State& plan_;
  PatchSink& sink_;
  const std::function<void(const ResampledLayer&)>& watch_;
  std::unique_ptr<PatchCursor> cursor_;
  ResampleReport report_;
};

void Resample::take(const ResampledLayer& layer) {
  ResampleReport::OfType& type = report_.types[layer.type];
  tally(layer.from, layer.to, type);
  if (layer.emptied) {
    ++type.layers_emptied;
    type.cells_after -= std::uint64_t{1} << (2 * *layer.to);
  }
  type.loss.add(layer.loss);
  if (layer.loss.mean() > type.worst.mean()) {
    type.worst = layer.loss;
    type.worst_patch = layer.patch;
  }
  if (watch_) watch_(layer);
}

/// Only now it is known which layers of the new grid hold data.
void Resample::take_regridded(ResampleJob& job) {
  for (const Parcel& parcel : job.parcels.used()) {
    const auto layer = std::ranges::find(job.layers, parcel.type, &ResampledLayer::type);
    ResampleReport::OfType& type = report_.types[parcel.type];
    ++type.layers_regridded;
    type.cells_after += std::uint64_t{1} << (2 * layer->from);
  }
}

void Resample::consume(Job& base) {
  auto& job = static_cast<ResampleJob&>(base);
  bool kept = false;
  for (const ResampledLayer& layer : job.layers) {
    kept |= layer.to.has_value();
    if (!plan_.regridded) take(layer);
  }
  if (plan_.regridded) take_regridded(job);
  report_.patches_dropped += !kept;
  report_.layers_stored += job.layers_stored;
  const auto parcels = job.parcels.used();
  report_.patches_emptied += kept && !plan_.regridded && parcels.empty();
  if (!parcels.empty()) sink_.put(job.patch, parcels);
}

/// Copies of the largest layer at work beside the stored ones: native, result and what resampling keeps.
constexpr std::uint64_t kBuffers = 3;

}  // namespace

ResampleReport run_resample(const ResamplePlan::State& plan, PatchSink& sink, const RunOptions& run,
                            const std::function<void(const ResampledLayer&)>& watch) {
  Resample stream(plan, sink, watch);
  run_stream(
      stream,
      {plan.patches, job_bytes(plan.largest, kBuffers), thread_bytes(*plan.source, sink, plan.largest)}, run);
  ResampleReport report = std::move(stream).report();
  for (std::size_t t = 0; plan.regridded && t < report.types.size(); ++t) {
    report.types[t].cells_before = plan.expected.types[t].cells_before;
  }
  return report;
}

}  // namespace apgm::ops
