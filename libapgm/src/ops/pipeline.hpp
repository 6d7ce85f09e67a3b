#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <span>
#include <vector>

#include "apgm/core/source.hpp"
#include "apgm/ops/run.hpp"

namespace apgm::ops {

/// Parcels of one patch. Their memory is kept from patch to patch.
class ParcelList {
 public:
  /// A parcel at the end; its buffers hold leftovers. Invalidates references to the others.
  Parcel& add(PatchIndex patch, TypeId type, std::int64_t stamp_ns);
  void drop_last() { --count_; }
  void clear() { count_ = 0; }
  std::span<Parcel> used() { return {parcels_.data(), count_}; }

 private:
  std::vector<Parcel> parcels_;
  std::size_t count_ = 0;
};

/// Cells at work. Each thread has its own, which the job holds while that thread is in `work`: their memory
/// is few and warm, however many jobs are in flight.
struct Desk {
  Layer scratch;              ///< on its way into a parcel
  std::vector<Layer> loaded;  ///< for operations that read more than one layer at once
};

/// One patch on its way through a Stream. Operations derive from it what else they need.
struct Job {
  virtual ~Job() = default;

  PatchIndex patch;
  std::uint64_t source_patches = 1;  ///< what the job counts for in the progress
  ParcelList parcels;
  std::uint64_t layers_stored = 0;  ///< of the parcels, passed on as stored bytes
  Desk desk;                        ///< of the thread in `work`; holds leftovers
  std::vector<Finding> findings;    ///< of `work`, handed to the caller in key order
  std::exception_ptr error;         ///< of `produce` or `work`, thrown in key order
};

/// An operation as three stages: a serial producer, parallel work, a serial consumer. Both serial stages see
/// the jobs in the order they were produced in.
class Stream {
 public:
  virtual ~Stream() = default;
  virtual std::unique_ptr<Job> make_job() const { return std::make_unique<Job>(); }
  /// Fills the next job; false at the end. Must not read cells.
  virtual bool produce(Job& job) = 0;
  virtual void work(Job& job) const = 0;
  virtual void consume(Job& job) = 0;
};

struct StreamSize {
  std::uint64_t patches = 0;       ///< sum of Job::source_patches, for the progress
  std::uint64_t job_bytes = 0;     ///< most memory one job can take
  std::uint64_t thread_bytes = 0;  ///< and one thread beside its jobs
};

/// Runs all jobs of `stream` on `run.threads` threads.
///
/// Guarantees: at most token_limit() jobs exist at any time and are reused; the first failure in key order is
/// thrown as it is, whatever the number of threads; `progress` and `findings` are called by one thread at a
/// time.
/// @return  jobs made: the most that were in flight
/// @throws  Error{kCancelled}; {kLimit} if the budget does not hold one job
std::size_t run_stream(Stream& stream, const StreamSize& size, const RunOptions& run);

/// Jobs in flight: a few for each thread, fewer if `run.max_memory_bytes` asks for it.
/// @throws Error{kLimit} with the least budget that holds one job
std::size_t token_limit(const StreamSize& size, std::size_t threads, const RunOptions& run);

/// Bytes of the largest layer of each type of a source, from its summary.
std::vector<std::uint64_t> largest_layers(const PatchSource& source);

/// Most memory of a job whose patches hold one layer a type, each at its largest: all of them stored, and
/// `buffers` of the largest at work.
std::uint64_t job_bytes(std::span<const std::uint64_t> largest, std::uint64_t buffers);

/// Most memory a thread takes to load from `source` and pack for `sink` (WorkingMemory).
std::uint64_t thread_bytes(const PatchSource& source, const PatchSink& sink,
                           std::span<const std::uint64_t> largest);

/// Adds a layer to the parcels of `job` as it is: the stored bytes where `as_stored` and the source has them,
/// else its cells, packed.
void pass_layer(const PatchSource& source, const LayerInfo& info, TypeId type, const PatchSink& sink,
                bool as_stored, Job& job);

/// Adds the cells in `job.desk.scratch` to its parcels, packed, unless they hold no data.
void pack_scratch(TypeId type, std::int64_t stamp_ns, const PatchSink& sink, Job& job);

}  // namespace apgm::ops
