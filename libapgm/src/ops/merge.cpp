#include "apgm/ops/merge.hpp"

#include <algorithm>
#include <tuple>

#include "apgm/core/budget.hpp"
#include "apgm/core/working_memory.hpp"
#include "apgm/fuse/framework.hpp"
#include "lockstep.hpp"
#include "merge_state.hpp"
#include "pipeline.hpp"

namespace apgm::ops {
namespace {

using Lane = MergePlan::State::Lane;

/// A layer of one lane, to be fused into a type of the result.
struct Claim {
  TypeId type;
  std::uint32_t lane;
  const LayerInfo* info;
};

struct Conflict {
  TypeId type = 0;
  int step = 0;
  std::vector<float> k;
};

struct MergeJob final : Job {
  std::vector<PatchInfo> patches;    ///< by lane
  std::vector<std::uint32_t> lanes;  ///< that hold the patch, ascending
  std::vector<Claim> claims;
  std::vector<FuseInput> inputs;
  LayerFuser fuser;
  std::vector<Conflict> conflicts;
  std::size_t conflict_count = 0;
  std::uint64_t total_conflicts = 0;
};

class Merge final : public Stream {
 public:
  Merge(const MergePlan::State& plan, PatchSink& sink) : plan_(plan), sink_(sink) {
    cursors_.reserve(plan.lanes.size());
    for (const Lane& lane : plan.lanes) cursors_.emplace_back(*lane.source, lane.name);
  }

  std::unique_ptr<Job> make_job() const override {
    auto job = std::make_unique<MergeJob>();
    job->patches.resize(plan_.lanes.size());
    return job;
  }

  bool produce(Job& base) override;
  void work(Job& base) const override;
  void consume(Job& base) override;
  const MergeReport& report() const { return report_; }

 private:
  void fuse(std::span<const Claim> claims, MergeJob& job) const;

  const MergePlan::State& plan_;
  PatchSink& sink_;
  std::vector<PatchLane> cursors_;
  MergeReport report_;
};

bool Merge::produce(Job& base) {
  auto& job = static_cast<MergeJob&>(base);
  bool any = false;
  std::uint64_t key = 0;
  for (const PatchLane& cursor : cursors_) {
    if (cursor.ended() || (any && cursor.key() >= key)) continue;
    any = true;
    key = cursor.key();
  }
  if (!any) return false;
  job.lanes.clear();
  for (std::uint32_t lane = 0; lane < cursors_.size(); ++lane) {
    if (cursors_[lane].ended() || cursors_[lane].key() != key) continue;
    cursors_[lane].take(job.patches[lane]);
    job.lanes.push_back(lane);
  }
  job.patch = job.patches[job.lanes[0]].patch;
  job.source_patches = job.lanes.size();
  return true;
}

void Merge::work(Job& base) const {
  auto& job = static_cast<MergeJob&>(base);
  job.claims.clear();
  job.conflict_count = 0;
  job.total_conflicts = 0;
  for (const std::uint32_t lane : job.lanes) {
    for (const LayerInfo& info : job.patches[lane].layers) {
      job.claims.push_back({plan_.lanes[lane].types[info.type], lane, &info});
    }
  }
  std::ranges::sort(job.claims, [](const Claim& a, const Claim& b) {
    return std::tie(a.type, a.lane) < std::tie(b.type, b.lane);
  });
  for (std::size_t i = 0; i < job.claims.size();) {
    std::size_t end = i + 1;
    while (end < job.claims.size() && job.claims[end].type == job.claims[i].type) ++end;
    fuse(std::span(job.claims).subspan(i, end - i), job);
    i = end;
  }
}

void Merge::fuse(std::span<const Claim> claims, MergeJob& job) const {
  const TypeId type = claims[0].type;
  const Lane& first = plan_.lanes[claims[0].lane];
  const LayerInfo& only = *claims[0].info;
  if (claims.size() == 1 && first.alpha == 1.0f && only.step <= plan_.required.value_or(kMaxStep)) {
    const bool as_stored = sink_.takes_stored() && first.stored_ok[only.type];
    pass_layer(*first.source, only, type, sink_, as_stored, job);
    return;
  }
  if (job.desk.loaded.size() < claims.size()) job.desk.loaded.resize(claims.size());
  job.inputs.clear();
  std::int64_t stamp_ns = 0;
  for (std::size_t i = 0; i < claims.size(); ++i) {
    const Lane& lane = plan_.lanes[claims[i].lane];
    const LayerInfo& info = *claims[i].info;
    const LayerType& own = lane.source->header().types[info.type];
    lane.source->load(info, job.desk.loaded[i]);
    // A shifted or regridded input may name layers that turn out empty: they must not decide the resolution.
    if (is_vacuous(job.desk.loaded[i], own)) continue;
    stamp_ns = job.inputs.empty() ? info.stamp_ns : std::max(stamp_ns, info.stamp_ns);
    job.inputs.push_back({&job.desk.loaded[i], &own, lane.alpha});
  }
  if (job.inputs.empty()) return;
  Conflict* conflict = nullptr;
  if (plan_.options.conflict != nullptr && job.inputs.size() > 1) {
    if (job.conflict_count == job.conflicts.size()) job.conflicts.emplace_back();
    conflict = &job.conflicts[job.conflict_count++];
  }
  const CombineReport fused = job.fuser.fuse(job.inputs, plan_.required, plan_.options.rule, job.desk.scratch,
                                             conflict != nullptr ? &conflict->k : nullptr);
  job.total_conflicts += fused.total_conflicts;
  if (conflict != nullptr) {
    conflict->type = type;
    conflict->step = job.desk.scratch.step();
  }
  pack_scratch(type, stamp_ns, sink_, job);
}

void Merge::consume(Job& base) {
  auto& job = static_cast<MergeJob&>(base);
  report_.total_conflicts += job.total_conflicts;
  for (const Conflict& c : std::span(job.conflicts).first(job.conflict_count)) {
    plan_.options.conflict->put(job.patch, c.type, c.step, c.k);
  }
  const auto parcels = job.parcels.used();
  if (parcels.empty()) return;
  ++report_.patches;
  report_.layers += parcels.size();
  report_.layers_stored += job.layers_stored;
  sink_.put(job.patch, parcels);
}

StreamSize job_size(const MergePlan::State& plan, const PatchSink& sink) {
  StreamSize size;
  std::vector<std::uint64_t> largest(plan.header.types.size());
  for (const Lane& lane : plan.lanes) {
    const auto own = largest_layers(*lane.sizes);
    for (std::size_t t = 0; t < own.size(); ++t) {
      std::uint64_t& bytes = largest[lane.types[t]];
      bytes = std::max(bytes, own[t]);
    }
  }
  // Each lane's layer as loaded and as resampled, and the result; conflicts stay until the patch is put.
  size.job_bytes = job_bytes(largest, 2 * plan.lanes.size() + 1);
  if (plan.options.conflict != nullptr) {
    for (const std::uint64_t bytes : largest) size.job_bytes += bytes;
  }
  const std::uint64_t most = largest.empty() ? 0 : *std::ranges::max_element(largest);
  for (const Lane& lane : plan.lanes) {
    size.thread_bytes = std::max(size.thread_bytes, working_bytes(*lane.source, most));
  }
  size.thread_bytes += working_bytes(sink, most);
  return size;
}

}  // namespace

MergeReport run_merge(const MergePlan::State& plan, PatchSink& sink, const RunOptions& run) {
  if (run.findings) {
    for (const Finding& finding : plan.findings) run.findings(finding);
  }
  StreamSize size = job_size(plan, sink);
  RunOptions rest = run;
  if (run.max_memory_bytes != 0 && plan.plan_bytes > 0) {
    const std::uint64_t least = plan.plan_bytes + size.job_bytes + size.thread_bytes;
    if (run.max_memory_bytes < least) {
      throw over_budget("the memory budget does not hold the lists of the layers that are shifted", least);
    }
    rest.max_memory_bytes -= plan.plan_bytes;
  }
  for (const Lane& lane : plan.lanes) size.patches += lane.source->summary().patches;
  Merge merge(plan, sink);
  run_stream(merge, size, rest);
  return merge.report();
}

}  // namespace apgm::ops
