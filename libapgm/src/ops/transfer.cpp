#include "transfer.hpp"

#include <string>

namespace apgm::ops {

struct Transfer::TransferJob final : Job {
  PatchInfo info;
  std::vector<std::uint8_t> keep;
  std::uint64_t damaged = 0;
};

std::vector<std::optional<TypeId>> map_types(const TypeTable& from, const TypeTable& to) {
  std::vector<std::optional<TypeId>> ids;
  ids.reserve(from.size());
  for (const LayerType& type : from) {
    ids.push_back(to.find(type.name));
    if (ids.back() && !to[*ids.back()].same_meaning(type)) {
      throw Error(ErrorCode::kIncompatible, "layer type '" + type.name + "' differs between source and sink");
    }
  }
  return ids;
}

TransferReport Transfer::run(const RunOptions& options) {
  report_ = {};
  const auto bound = region != nullptr ? region->range() : std::nullopt;
  if (!bound || !bound->empty()) {
    cursor_ = source_.patches(bound);
    if (like != nullptr) like_cursor_ = like->patches(bound);
    StreamSize size;
    // A bound makes the number of patches unknown before the walk; all of them is an upper bound.
    size.patches = source_.summary().patches;
    const auto largest = largest_layers(source_);
    size.job_bytes = job_bytes(largest, kBuffers);
    size.thread_bytes = thread_bytes(source_, sink_, largest);
    run_stream(*this, size, options);
    cursor_.reset();
    like_cursor_.reset();
  }
  return report_;
}

std::unique_ptr<Job> Transfer::make_job() const { return std::make_unique<TransferJob>(); }

bool Transfer::is_like(PatchIndex patch) {
  const std::uint64_t key = curve_key(patch);
  while (!like_ended_ && (!like_started_ || like_key_ < key)) {
    like_ended_ = !like_cursor_->next(like_patch_);
    like_started_ = true;
    if (!like_ended_) like_key_ = curve_key(like_patch_.patch);
  }
  return !like_ended_ && like_key_ == key;
}

bool Transfer::produce(Job& base) {
  auto& job = static_cast<TransferJob&>(base);
  do {
    if (!cursor_->next(job.info)) return false;
  } while (like_cursor_ && !is_like(job.info.patch));
  job.patch = job.info.patch;
  job.damaged = 0;
  return true;
}

void Transfer::work(Job& base) const {
  auto& job = static_cast<TransferJob&>(base);
  const auto cover = region != nullptr ? region->cover(job.patch) : PolygonArea::Cover::kAll;
  if (cover == PolygonArea::Cover::kNone) return;
  for (const LayerInfo& info : job.info.layers) {
    if (!types_[info.type]) continue;
    try {
      pass(info, cover, job);
    } catch (const Error& e) {
      if (!salvage || e.code() != ErrorCode::kDamaged) throw;
      ++job.damaged;
      job.findings.push_back({Finding::Kind::kLoss, "left out: " + e.message()});
    }
  }
}

void Transfer::pass(const LayerInfo& info, PolygonArea::Cover cover, TransferJob& job) const {
  const TypeId type = *types_[info.type];
  if (cover == PolygonArea::Cover::kPart) cover = region->mask(job.patch, info.step, job.keep);
  if (cover == PolygonArea::Cover::kNone) return;
  if (cover == PolygonArea::Cover::kAll) {
    pass_layer(source_, info, type, sink_, !reencode && sink_.takes_stored(), job);
    return;
  }
  source_.load(info, job.desk.scratch);
  clip(source_.header().types[info.type], job.keep, job.desk.scratch);
  pack_scratch(type, info.stamp_ns, sink_, job);
}

void Transfer::consume(Job& base) {
  auto& job = static_cast<TransferJob&>(base);
  report_.damaged += job.damaged;
  const auto parcels = job.parcels.used();
  if (parcels.empty()) return;
  ++report_.patches;
  report_.layers += parcels.size();
  report_.layers_stored += job.layers_stored;
  sink_.put(job.patch, parcels);
}

}  // namespace apgm::ops
