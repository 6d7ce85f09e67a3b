#include "apgm/ops/statistics.hpp"

#include <algorithm>
#include <bit>
#include <utility>

#include "pipeline.hpp"

namespace apgm {
namespace {

/// Counts of one layer of {O, F}: one pass over both planes.
void count_occupancy(const Layer& layer, CellStatistics& s) {
  const auto o = layer.plane(0), f = layer.plane(1);
  std::uint32_t known = 0, occupied = 0, free = 0;
  double most = 0;
  for (std::size_t i = 0; i < o.size(); ++i) {
    known += (std::bit_cast<std::uint32_t>(o[i]) | std::bit_cast<std::uint32_t>(f[i])) != 0;
    occupied += o[i] > f[i];  // BetP(O) = O + (1 - O - F) / 2
    free += o[i] < f[i];
    most = std::max(most, static_cast<double>(o[i]) + static_cast<double>(f[i]));
  }
  s.known_cells += known;
  s.occupied_cells += occupied;
  s.free_cells += free;
  s.max_mass_sum = std::max(s.max_mass_sum, most);
}

void count_any(const Layer& layer, const LayerType& type, CellStatistics& s) {
  const std::size_t masses = type.hypotheses.size();
  for (std::size_t i = 0; i < layer.cells(); ++i) {
    bool known = false;
    double sum = 0;
    for (int c = 0; c < layer.channels(); ++c) {
      const float v = layer.plane(c)[i];
      known |= std::bit_cast<std::uint32_t>(v) != std::bit_cast<std::uint32_t>(type.background(c));
      if (static_cast<std::size_t>(c) < masses) sum += static_cast<double>(v);
    }
    s.known_cells += known;
    s.max_mass_sum = std::max(s.max_mass_sum, sum);
  }
}

struct CountJob final : ops::Job {
  PatchInfo info;
  std::vector<CellStatistics> of_layer;
};

class Counter final : public ops::Stream {
 public:
  explicit Counter(const PatchSource& source)
      : source_(source), cursor_(source.patches()), totals_(source.header().types.size()) {}

  std::unique_ptr<ops::Job> make_job() const override { return std::make_unique<CountJob>(); }

  bool produce(ops::Job& base) override { return cursor_->next(static_cast<CountJob&>(base).info); }

  void work(ops::Job& base) const override {
    auto& job = static_cast<CountJob&>(base);
    job.of_layer.assign(job.info.layers.size(), {});
    for (std::size_t i = 0; i < job.info.layers.size(); ++i) {
      const LayerType& type = source_.header().types[job.info.layers[i].type];
      source_.load(job.info.layers[i], job.desk.scratch);
      job.of_layer[i].cells = job.desk.scratch.cells();
      if (type.is_occupancy()) {
        count_occupancy(job.desk.scratch, job.of_layer[i]);
      } else {
        count_any(job.desk.scratch, type, job.of_layer[i]);
      }
    }
  }

  void consume(ops::Job& base) override {
    auto& job = static_cast<CountJob&>(base);
    for (std::size_t i = 0; i < job.of_layer.size(); ++i) {
      const CellStatistics& from = job.of_layer[i];
      CellStatistics& to = totals_[job.info.layers[i].type];
      to.cells += from.cells;
      to.known_cells += from.known_cells;
      to.occupied_cells += from.occupied_cells;
      to.free_cells += from.free_cells;
      to.max_mass_sum = std::max(to.max_mass_sum, from.max_mass_sum);
    }
  }

  std::vector<CellStatistics> totals() && { return std::move(totals_); }

 private:
  const PatchSource& source_;
  std::unique_ptr<PatchCursor> cursor_;
  std::vector<CellStatistics> totals_;
};

}  // namespace

std::vector<CellStatistics> statistics(const PatchSource& source, const RunOptions& run) {
  Counter counter(source);
  const auto largest = ops::largest_layers(source);
  const std::uint64_t most = largest.empty() ? 0 : *std::ranges::max_element(largest);
  const std::uint64_t bytes[] = {most};
  ops::run_stream(counter, {source.summary().patches, ops::job_bytes(bytes, 1)}, run);
  return std::move(counter).totals();
}

}  // namespace apgm
