#include "pipeline.hpp"

#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_pipeline.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <mutex>
#include <utility>

#include "apgm/core/budget.hpp"
#include "apgm/core/working_memory.hpp"
#include "hand_over.hpp"

namespace apgm::ops {
namespace {

/// Enough that threads do not wait while the consumer is at a slow patch.
constexpr std::size_t kTokensPerThread = 4;
/// What a layer in flight costs beside its values: structs, block headers, rounding of allocations.
constexpr std::uint64_t kLayerOverhead = 1024;
/// Codecs hold this many copies of the layer at hand, at most.
constexpr std::uint64_t kCodecBuffers = 3;

void clear(Job& job) {
  job.source_patches = 1;
  job.parcels.clear();
  job.layers_stored = 0;
  job.findings.clear();
  job.error = nullptr;
}

/// The stages of a stream with what every run does beside them: cancelling, findings, progress, and failures
/// in order.
class Runner final : public Stream {
 public:
  Runner(Stream& stream, const StreamSize& size, const RunOptions& run)
      : stream_(stream), total_(size.patches), run_(run) {}

  std::unique_ptr<Job> make_job() const override { return stream_.make_job(); }

  /// Failures travel with the job, so that an earlier patch's own failure comes first.
  bool produce(Job& job) override {
    if (ended_) return false;
    clear(job);
    try {
      if (run_.cancel != nullptr && run_.cancel->load(std::memory_order_relaxed)) {
        throw Error(ErrorCode::kCancelled, "cancelled");
      }
      ended_ = !stream_.produce(job);
      return !ended_;
    } catch (...) {
      job.error = std::current_exception();
      ended_ = true;
      return true;
    }
  }

  void work(Job& job) const override {
    if (job.error) return;
    try {
      stream_.work(job);
    } catch (...) {
      job.error = std::current_exception();
    }
  }

  void consume(Job& job) override {
    if (run_.findings) {
      for (const Finding& finding : job.findings) run_.findings(finding);
    }
    if (job.error) std::rethrow_exception(job.error);
    stream_.consume(job);
    done_ += job.source_patches;
    if (run_.progress) run_.progress(done_, total_);
  }

 private:
  Stream& stream_;
  std::uint64_t total_;
  const RunOptions& run_;
  std::uint64_t done_ = 0;
  bool ended_ = false;
};

std::size_t run_serial(Stream& stages) {
  const std::unique_ptr<Job> job = stages.make_job();
  while (stages.produce(*job)) {
    stages.work(*job);
    stages.consume(*job);
  }
  return 1;
}

/// Jobs at rest. Producer and consumer may run at the same time.
class JobPool {
 public:
  explicit JobPool(const Stream& stages) : stages_(stages) {}
  /// A failure leaves jobs between stages.
  ~JobPool() {
    for (const auto& job : jobs_) receive(job.get());
  }
  JobPool(const JobPool&) = delete;
  JobPool& operator=(const JobPool&) = delete;

  Job* take() {
    const std::scoped_lock lock(mutex_);
    if (free_.empty()) {
      jobs_.push_back(stages_.make_job());
      free_.reserve(jobs_.size());
      return jobs_.back().get();
    }
    Job* job = free_.back();
    free_.pop_back();
    return job;
  }
  void give(Job* job) {
    const std::scoped_lock lock(mutex_);
    free_.push_back(job);
  }
  std::size_t made() const { return jobs_.size(); }

 private:
  const Stream& stages_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<Job>> jobs_;
  std::vector<Job*> free_;
};

/// A function that TBB copies when a pipeline starts: who calls a copy sees all of it.
template <class Function>
class Stage {
 public:
  explicit Stage(const Function& function) : function_(function) {}
  Stage(const Stage& other) : function_(other.function_) { hand_over(&kCopied); }
  Stage& operator=(const Stage&) = delete;

  template <class... Arguments>
  auto operator()(Arguments&&... arguments) const {
    receive(&kCopied);
    return function_(std::forward<Arguments>(arguments)...);
  }

 private:
  static constexpr char kCopied{};
  Function function_;
};

std::size_t run_parallel(Stream& stages, std::size_t threads, std::size_t tokens) {
  namespace tbb = oneapi::tbb;
  JobPool pool(stages);
  tbb::enumerable_thread_specific<Desk> desks;
  const char first{}, last{};  // addresses that stand for what TBB keeps in order
  const auto produce = [&](tbb::flow_control& flow) -> Job* {
    const Turn turn(&first);
    Job* job = pool.take();
    const Turn of_job(job);
    if (stages.produce(*job)) return job;
    pool.give(job);
    flow.stop();
    return nullptr;
  };
  const auto work = [&](Job* job) {
    const Turn of_job(job);
    Desk& desk = desks.local();
    std::swap(job->desk, desk);
    stages.work(*job);
    std::swap(job->desk, desk);
    hand_over(&desks);
    return job;
  };
  const auto consume = [&](Job* job) {
    const Turn of_job(job), turn(&last);
    stages.consume(*job);
    pool.give(job);
  };
  const AtEnd ended{{&first, &last, &desks}};
  tbb::task_arena arena(static_cast<int>(threads));
  arena.execute([&] {
    tbb::parallel_pipeline(
        tokens, tbb::make_filter<void, Job*>(tbb::filter_mode::serial_in_order, Stage(produce)) &
                    tbb::make_filter<Job*, Job*>(tbb::filter_mode::parallel, Stage(work)) &
                    tbb::make_filter<Job*, void>(tbb::filter_mode::serial_in_order, Stage(consume)));
  });
  return pool.made();
}

std::size_t thread_count(const RunOptions& run) {
  if (run.threads < 0) throw Error(ErrorCode::kInvalidArgument, "the number of threads is negative");
  // TBB says on stderr when it is asked for more than it may start.
  using Control = oneapi::tbb::global_control;
  const std::size_t most = Control::active_value(Control::max_allowed_parallelism);
  return run.threads == 0 ? most : std::min(static_cast<std::size_t>(run.threads), most);
}

}  // namespace

Parcel& ParcelList::add(PatchIndex patch, TypeId type, std::int64_t stamp_ns) {
  if (count_ == parcels_.size()) parcels_.emplace_back();
  Parcel& parcel = parcels_[count_++];
  parcel.patch = patch;
  parcel.type = type;
  parcel.stamp_ns = stamp_ns;
  parcel.state = Parcel::State::kNothing;
  return parcel;
}

std::size_t token_limit(const StreamSize& size, std::size_t threads, const RunOptions& run) {
  const std::size_t wanted = threads == 1 ? 1 : threads * kTokensPerThread;
  const std::uint64_t budget = run.max_memory_bytes;
  if (budget == 0) return wanted;
  const std::uint64_t job = std::max<std::uint64_t>(size.job_bytes, 1);
  // As many threads as jobs at first, then all threads and more jobs.
  std::uint64_t fit = budget / (job + size.thread_bytes);
  if (fit == 0)
    throw over_budget("the memory budget does not hold one patch at work", job + size.thread_bytes);
  if (fit > threads) fit = (budget - size.thread_bytes * threads) / job;
  return static_cast<std::size_t>(std::min<std::uint64_t>(wanted, fit));
}

std::size_t run_stream(Stream& stream, const StreamSize& size, const RunOptions& run) {
  const std::size_t threads = thread_count(run);
  const std::size_t tokens = token_limit(size, threads, run);
  Runner runner(stream, size, run);
  return tokens == 1 ? run_serial(runner) : run_parallel(runner, std::min(threads, tokens), tokens);
}

std::vector<std::uint64_t> largest_layers(const PatchSource& source) {
  const Summary summary = source.summary();
  const TypeTable& types = source.header().types;
  std::vector<std::uint64_t> bytes(types.size());
  for (std::size_t t = 0; t < std::min(types.size(), summary.types.size()); ++t) {
    for (int step = kMaxStep; step >= 0 && bytes[t] == 0; --step) {
      if (summary.types[t].layers_at[static_cast<std::size_t>(step)] == 0) continue;
      const std::uint64_t cells = std::uint64_t{1} << (2 * step);
      bytes[t] = cells * sizeof(float) * types[static_cast<TypeId>(t)].channels.size();
    }
  }
  return bytes;
}

std::uint64_t job_bytes(std::span<const std::uint64_t> largest, std::uint64_t buffers) {
  std::uint64_t sum = 0, most = 0;
  for (const std::uint64_t bytes : largest) {
    if (bytes == 0) continue;
    sum += bytes + kLayerOverhead;
    most = std::max(most, bytes);
  }
  return sum + (buffers + kCodecBuffers) * most + kLayerOverhead;
}

std::uint64_t thread_bytes(const PatchSource& source, const PatchSink& sink,
                           std::span<const std::uint64_t> largest) {
  const std::uint64_t most = largest.empty() ? 0 : *std::ranges::max_element(largest);
  return working_bytes(source, most) + working_bytes(sink, most);
}

namespace {

/// Runs `fill` on a new parcel of `job`; the parcel does not stay if that fails or finds no data. So a
/// salvage can go on with the other layers.
template <typename Fill>
void add_parcel(TypeId type, std::int64_t stamp_ns, Job& job, Fill fill) {
  Parcel& parcel = job.parcels.add(job.patch, type, stamp_ns);
  try {
    fill(parcel);
  } catch (...) {
    job.parcels.drop_last();
    throw;
  }
  if (parcel.state == Parcel::State::kNothing) job.parcels.drop_last();
}

}  // namespace

void pass_layer(const PatchSource& source, const LayerInfo& info, TypeId type, const PatchSink& sink,
                bool as_stored, Job& job) {
  bool stored = false;
  if (as_stored) {
    add_parcel(type, info.stamp_ns, job, [&](Parcel& parcel) {
      stored = source.load_stored(info, parcel.stored);
      if (!stored) return;
      parcel.state = Parcel::State::kStored;
      sink.pack(parcel);
      job.layers_stored += parcel.state == Parcel::State::kStored;
    });
  }
  if (stored) return;
  source.load(info, job.desk.scratch);
  pack_scratch(type, info.stamp_ns, sink, job);
}

void pack_scratch(TypeId type, std::int64_t stamp_ns, const PatchSink& sink, Job& job) {
  job.desk.scratch.stamp_ns = stamp_ns;
  add_parcel(type, stamp_ns, job, [&](Parcel& parcel) {
    parcel.state = Parcel::State::kCells;
    std::swap(parcel.cells, job.desk.scratch);
    sink.pack(parcel);
    // A sink that encodes leaves the buffer for the next layer; one that keeps cells needs it until `put`.
    if (parcel.state != Parcel::State::kCells) std::swap(parcel.cells, job.desk.scratch);
  });
}

}  // namespace apgm::ops
