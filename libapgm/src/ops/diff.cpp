#include "apgm/ops/diff.hpp"

#include <algorithm>

#include "apgm/core/budget.hpp"
#include "apgm/fuse/resample.hpp"
#include "diff_cells.hpp"
#include "diff_plan.hpp"
#include "diff_regions.hpp"
#include "lockstep.hpp"
#include "pipeline.hpp"

namespace apgm {
namespace ops {
namespace {

/// Patches that are passed over at once before progress is told and cancellation seen.
constexpr std::uint64_t kMostSkipped = 4096;

struct LayerCounts {
  std::uint64_t added = 0, removed = 0, changed = 0, equal = 0, of_two_steps = 0, of_two_stamps = 0;

  void add(const LayerCounts& o) {
    added += o.added;
    removed += o.removed;
    changed += o.changed;
    equal += o.equal;
    of_two_steps += o.of_two_steps;
    of_two_stamps += o.of_two_stamps;
  }
};

struct PatchCounts {
  std::uint64_t added = 0, removed = 0, changed = 0, equal = 0;
};

/// A layer of a patch as both maps have it; at least one does.
struct Pair {
  TypeId type = 0;  ///< of the joined table
  const LayerInfo* a = nullptr;
  const LayerInfo* b = nullptr;
  LayerInfo info_a, info_b;

  bool known_equal() const {
    return a != nullptr && b != nullptr && a->content_hash != 0 && a->content_hash == b->content_hash &&
           a->step == b->step;
  }
  bool two_stamps() const { return a != nullptr && b != nullptr && a->stamp_ns != b->stamp_ns; }
};

/// What was found of one Pair.
struct Found {
  TypeId type = 0;
  LayerCounts layers;
  CellSums sums;
};

struct DiffJob final : Job {
  std::vector<Pair> pairs;
  std::vector<Found> found;
  PatchCounts patches;
  PatchBlocks blocks, layer_blocks;
  Layer a, b, coarse;
  std::vector<CellDiff> cells;
  int cells_step = -1;  ///< -1: nothing for the sink
};

/// A loaded layer, empty where the map has none or one without data.
struct Side {
  const LayerInfo* info = nullptr;
  const LayerType* type = nullptr;
  Layer* cells = nullptr;
  explicit operator bool() const { return cells != nullptr; }
};

class Diff final : public Stream {
 public:
  Diff(const DiffPlan& plan, const DiffInput& reference, const DiffInput& other, const DiffOptions& options)
      : plan_(plan),
        options_(options),
        walk_(*plan.reference, reference.name, *plan.other, other.name, plan.range),
        skipped_layers_(plan.types.size()),
        layers_(plan.types.size()),
        sums_(plan.types.size()) {
    if (options.level == DiffLevel::kBelief) tolerance_ = options.tolerance;
  }

  std::unique_ptr<Job> make_job() const override { return std::make_unique<DiffJob>(); }
  bool produce(Job& base) override;
  void work(Job& base) const override;
  void consume(Job& base) override;
  /// After the run.
  void report(const Frame& frame, DiffReport& out) const;

 private:
  void pair_up(std::vector<Pair>& pairs) const;
  bool skip(const std::vector<Pair>& pairs);
  void look(const Pair& pair, DiffJob& job, bool& has_a, bool& has_b, bool& differs) const;
  Side load(const PatchSource& source, const LayerInfo* info, Layer& cells) const;
  bool look_at_cells(const Pair& pair, Side a, Side b, DiffJob& job, Found& found) const;
  void tell_equal(const Pair& pair, const Layer& layer, DiffJob& job) const;

  const DiffPlan& plan_;
  const DiffOptions& options_;
  std::optional<double> tolerance_;
  // The producer's alone, until the end.
  Lockstep walk_;
  std::vector<LayerCounts> skipped_layers_;
  std::uint64_t skipped_patches_ = 0;
  // The consumer's.
  std::vector<LayerCounts> layers_;
  std::vector<CellSums> sums_;
  PatchCounts patches_;
  RegionFinder regions_;
};

/// Ids of both maps rise with those of the joined table: all are sorted by name.
void Diff::pair_up(std::vector<Pair>& pairs) const {
  pairs.clear();
  const auto left = walk_.left(), right = walk_.right();
  std::size_t i = 0, k = 0;
  while (i < left.size() || k < right.size()) {
    if (i < left.size() && !plan_.of_reference[left[i].type]) {
      ++i;
      continue;
    }
    if (k < right.size() && !plan_.of_other[right[k].type]) {
      ++k;
      continue;
    }
    Pair& pair = pairs.emplace_back();
    const bool has_a = i < left.size(), has_b = k < right.size();
    const TypeId of_a = has_a ? *plan_.of_reference[left[i].type] : TypeId{0};
    const TypeId of_b = has_b ? *plan_.of_other[right[k].type] : TypeId{0};
    pair.type = !has_b || (has_a && of_a < of_b) ? of_a : of_b;
    if (has_a && of_a == pair.type) pair.a = &left[i++];
    if (has_b && of_b == pair.type) pair.b = &right[k++];
  }
}

/// Counts a patch that is equal in both maps without a look at its cells.
bool Diff::skip(const std::vector<Pair>& pairs) {
  for (const Pair& pair : pairs) {
    if (!pair.known_equal() || pair.type == plan_.drawn) return false;
  }
  for (const Pair& pair : pairs) {
    ++skipped_layers_[pair.type].equal;
    skipped_layers_[pair.type].of_two_stamps += pair.two_stamps();
  }
  skipped_patches_ += !pairs.empty();
  return true;
}

bool Diff::produce(Job& base) {
  auto& job = static_cast<DiffJob&>(base);
  job.source_patches = 0;
  for (std::uint64_t skipped = 0; skipped < kMostSkipped; ++skipped) {
    if (!walk_.next()) break;
    job.source_patches += static_cast<std::uint64_t>(!walk_.left().empty());
    job.source_patches += static_cast<std::uint64_t>(!walk_.right().empty());
    pair_up(job.pairs);
    if (skip(job.pairs)) continue;
    job.patch = walk_.patch();
    // The walk goes on before the job is worked on.
    for (Pair& pair : job.pairs) {
      if (pair.a != nullptr) pair.info_a = *pair.a;
      if (pair.b != nullptr) pair.info_b = *pair.b;
    }
    return true;
  }
  // Nothing but equal patches: progress is told, and the end is asked for once more.
  job.pairs.clear();
  return job.source_patches > 0;
}

void Diff::work(Job& base) const {
  auto& job = static_cast<DiffJob&>(base);
  job.found.clear();
  job.patches = {};
  job.blocks.clear();
  job.cells_step = -1;
  bool has_a = false, has_b = false, differs = false;
  for (Pair& pair : job.pairs) {
    if (pair.a != nullptr) pair.a = &pair.info_a;
    if (pair.b != nullptr) pair.b = &pair.info_b;
    look(pair, job, has_a, has_b, differs);
  }
  if (!has_a && !has_b) return;
  ++(!has_a    ? job.patches.added
     : !has_b  ? job.patches.removed
     : differs ? job.patches.changed
               : job.patches.equal);
}

Side Diff::load(const PatchSource& source, const LayerInfo* info, Layer& cells) const {
  if (info == nullptr) return {};
  const LayerType& type = source.header().types[info->type];
  source.load(*info, cells);
  if (info->content_hash == 0) {  // no file: cells may be in any form
    canonicalise(cells, type);
    if (is_vacuous(cells, type)) return {};
  }
  return {info, &type, &cells};
}

void Diff::look(const Pair& pair, DiffJob& job, bool& has_a, bool& has_b, bool& differs) const {
  Found found{pair.type, {}, {}};
  found.layers.of_two_stamps += pair.two_stamps();
  const auto count = [&](bool in_a, bool in_b, bool differ) {
    has_a |= in_a;
    has_b |= in_b;
    differs |= differ;
    ++(!in_a    ? found.layers.added
       : !in_b  ? found.layers.removed
       : differ ? found.layers.changed
                : found.layers.equal);
    job.found.push_back(std::move(found));
  };
  const bool hashed =
      (pair.a == nullptr || pair.a->content_hash != 0) && (pair.b == nullptr || pair.b->content_hash != 0);
  if (pair.known_equal()) {
    if (pair.type == plan_.drawn) tell_equal(pair, *load(*plan_.reference, pair.a, job.a).cells, job);
    return count(true, true, false);
  }
  if (options_.level == DiffLevel::kBytes && hashed) {
    if (pair.a != nullptr && pair.b != nullptr) found.layers.of_two_steps += pair.a->step != pair.b->step;
    return count(pair.a != nullptr, pair.b != nullptr, true);
  }
  const Side a = load(*plan_.reference, pair.a, job.a), b = load(*plan_.other, pair.b, job.b);
  if (!a && !b) return;
  if (a && b) {
    found.layers.of_two_steps += a.info->step != b.info->step;
    if (same_cells(*a.cells, *b.cells)) {
      tell_equal(pair, *a.cells, job);
      return count(true, true, false);
    }
  }
  const bool differ = options_.level == DiffLevel::kBytes || look_at_cells(pair, a, b, job, found);
  count(static_cast<bool>(a), static_cast<bool>(b), differ);
}

void Diff::tell_equal(const Pair& pair, const Layer& layer, DiffJob& job) const {
  if (pair.type != plan_.drawn) return;
  job.cells.resize(layer.cells());
  job.cells_step = layer.step();
  describe_equal(layer, plan_.types[pair.type], job.cells.data());
}

/// At least one side holds data. @return whether they differ as the level says
bool Diff::look_at_cells(const Pair& pair, Side a, Side b, DiffJob& job, Found& found) const {
  const LayerType& type = plan_.types[pair.type];
  const bool two_steps = a && b && a.cells->step() != b.cells->step();
  if (two_steps) {
    Side& fine = a.cells->step() > b.cells->step() ? a : b;
    const Side& other = &fine == &a ? b : a;
    resample(*fine.cells, *fine.type, other.cells->step(), job.coarse);
    fine.cells = &job.coarse;
  } else if (!a || !b) {
    job.coarse.reset(type, (a ? a : b).cells->step());
    (a ? b : a).cells = &job.coarse;
  }
  CellOutputs outputs;
  job.layer_blocks.clear();
  if (options_.regions) outputs.blocks = &job.layer_blocks;
  if (pair.type == plan_.drawn) {
    job.cells.resize(a.cells->cells());
    job.cells_step = a.cells->step();
    outputs.cells = job.cells.data();
  }
  compare(*a.cells, *b.cells, type, tolerance_, found.sums, outputs);
  job.blocks.join(job.layer_blocks);
  return found.sums.changed() > 0 || (two_steps && options_.level == DiffLevel::kCells);
}

void Diff::consume(Job& base) {
  auto& job = static_cast<DiffJob&>(base);
  for (const Found& found : job.found) {
    layers_[found.type].add(found.layers);
    sums_[found.type].add(found.sums);
  }
  patches_.added += job.patches.added;
  patches_.removed += job.patches.removed;
  patches_.changed += job.patches.changed;
  patches_.equal += job.patches.equal;
  regions_.add(job.patch, job.blocks);
  if (job.cells_step >= 0) options_.cells->put(job.patch, job.cells_step, job.cells);
}

void Diff::report(const Frame& frame, DiffReport& out) const {
  out.patches_added = patches_.added;
  out.patches_removed = patches_.removed;
  out.patches_changed = patches_.changed;
  out.patches_equal = patches_.equal + skipped_patches_;
  const bool by_cells = options_.level == DiffLevel::kBelief;
  for (TypeId t = 0; t < plan_.types.size(); ++t) {
    LayerCounts n = layers_[t];
    n.add(skipped_layers_[t]);
    TypeDiff type;
    type.type = plan_.types[t];
    type.layers_added = n.added;
    type.layers_removed = n.removed;
    type.layers_changed = n.changed;
    type.layers_equal = n.equal;
    type.layers_of_two_steps = n.of_two_steps;
    type.layers_of_two_stamps = n.of_two_stamps;
    sums_[t].report(frame, type);
    out.different |= by_cells ? type.changed.cells > 0 : n.added + n.removed + n.changed > 0;
    out.types.push_back(std::move(type));
  }
  if (options_.regions) out.regions = regions_.regions(frame);
}

StreamSize size_of(const DiffPlan& plan) {
  std::uint64_t most = 0;
  for (const PatchSource* source : {plan.reference, plan.other}) {
    for (const std::uint64_t bytes : largest_layers(*source)) most = std::max(most, bytes);
  }
  const std::uint64_t one[] = {most};
  // Both layers and a resampled one, and what a sink is told of each cell.
  return {plan.reference->summary().patches + plan.other->summary().patches,
          job_bytes(one, 3) + (plan.drawn ? most * sizeof(CellDiff) / sizeof(float) : 0)};
}

/// Patches that either map can hold where it is looked at.
std::uint64_t most_patches(const DiffPlan& plan) {
  const Summary a = plan.reference->summary(), b = plan.other->summary();
  PatchRange range = a.range;
  range.add(b.range);
  if (plan.range) {
    range.min = {std::max(range.min.x, plan.range->min.x), std::max(range.min.y, plan.range->min.y)};
    range.max = {std::min(range.max.x, plan.range->max.x), std::min(range.max.y, plan.range->max.y)};
  }
  if (range.empty()) return 0;
  const double area = (1.0 + range.max.x - range.min.x) * (1.0 + range.max.y - range.min.y);
  return static_cast<std::uint64_t>(std::min(static_cast<double>(a.patches + b.patches), area));
}

/// What is left of a budget beside the places that changed.
RunOptions beside_regions(const StreamSize& size, std::uint64_t region_bytes, const RunOptions& run) {
  RunOptions rest = run;
  check_budget(run.max_memory_bytes, region_bytes + size.job_bytes + size.thread_bytes,
               "the places that changed are listed to find regions");
  if (run.max_memory_bytes != 0) rest.max_memory_bytes -= region_bytes;
  return rest;
}

}  // namespace
}  // namespace ops

DiffReport diff(const DiffInput& reference, const DiffInput& other, const DiffOptions& options,
                const RunOptions& run) {
  const ops::DiffPlan plan = ops::plan_diff(reference, other, options);
  if (run.findings) {
    for (const Finding& finding : plan.findings) run.findings(finding);
  }
  DiffReport report;
  report.header_differences = plan.header_differences;
  ops::Diff stream(plan, reference, other, options);
  const ops::StreamSize size = ops::size_of(plan);
  if (options.regions) {
    const std::uint64_t bytes = ops::RegionFinder::most_bytes(ops::most_patches(plan));
    ops::run_stream(stream, size, ops::beside_regions(size, bytes, run));
  } else {
    ops::run_stream(stream, size, run);
  }
  stream.report(reference.source->header().frame, report);
  return report;
}

}  // namespace apgm
