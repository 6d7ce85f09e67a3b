#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "apgm/core/source.hpp"
#include "apgm/ops/run.hpp"
#include "pipeline.hpp"
#include "region.hpp"

namespace apgm::ops {

/// For each type of `from` its id in `to`; empty where `to` has no type of that name.
/// @throws Error{kIncompatible} if one name stands for different hypotheses, channels, heights or backgrounds
std::vector<std::optional<TypeId>> map_types(const TypeTable& from, const TypeTable& to);

struct TransferReport {
  std::uint64_t patches = 0;
  std::uint64_t layers = 0;
  std::uint64_t layers_stored = 0;
  std::uint64_t damaged = 0;
};

/// Streams patches of one source into one sink: what copy and crop share.
class Transfer final : public Stream {
 public:
  Transfer(const PatchSource& source, const TypeTable& sink_types, PatchSink& sink)
      : source_(source), sink_(sink), types_(map_types(source.header().types, sink_types)) {}

  const Region* region = nullptr;     ///< nullptr: everything
  const PatchSource* like = nullptr;  ///< only patches this source has
  bool reencode = false;
  bool salvage = false;

  /// Of ops::job_bytes.
  static constexpr std::uint64_t kBuffers = 1;

  TransferReport run(const RunOptions& options);

  std::unique_ptr<Job> make_job() const override;
  bool produce(Job& job) override;
  void work(Job& job) const override;
  void consume(Job& job) override;

 private:
  struct TransferJob;
  bool is_like(PatchIndex patch);
  void pass(const LayerInfo& info, PolygonArea::Cover cover, TransferJob& job) const;

  const PatchSource& source_;
  PatchSink& sink_;
  std::vector<std::optional<TypeId>> types_;
  std::unique_ptr<PatchCursor> cursor_, like_cursor_;
  PatchInfo like_patch_;
  std::uint64_t like_key_ = 0;
  bool like_started_ = false, like_ended_ = false;
  TransferReport report_;
};

}  // namespace apgm::ops
