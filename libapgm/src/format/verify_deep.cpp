#include <algorithm>

#include "layer_block.hpp"
#include "located.hpp"
#include "parallel.hpp"
#include "verify_state.hpp"

namespace apgm::format {
namespace {

/// Enough that starting threads costs nothing beside the decoding.
constexpr std::size_t kJobs = 4096;

/// True if cells of both decode alike and obey the same rules.
bool same_cells_space(const LayerType& a, const LayerType& b) {
  return a.hypotheses.size() == b.hypotheses.size() && a.channels.size() == b.channels.size() &&
         (a.policy == Policy::kSum) == (b.policy == Policy::kSum);
}

}  // namespace

/// A layer is decoded once for each kind of cells that some commit takes it for.
void Verification::decode_soon(Seen& block, const IndexEntry& entry, const LayerType& type) {
  const auto known =
      std::ranges::find_if(spaces_, [&](const LayerType& t) { return same_cells_space(t, type); });
  const auto space = static_cast<std::uint32_t>(known - spaces_.begin()) + 1;
  if (block.space == space) return;
  if (known == spaces_.end()) spaces_.push_back(type);
  block.space = space;
  jobs_.push_back({entry, space - 1, type.name, {}});
  if (jobs_.size() == kJobs) decode_now();
}

void Verification::decode_now() {
  std::uint64_t largest = 0;
  for (const DeepJob& job : jobs_)
    largest = std::max(largest, value_bytes(spaces_[job.space], job.entry.step));
  const int threads = decoding_threads(options_.max_memory_bytes, table_.capacity() * sizeof(Seen), largest,
                                       options_.threads);
  struct Buffers {
    std::vector<std::byte> bytes;
    Layer layer;
  };
  Spares<Buffers> spares;
  parallel_for(jobs_.size(), threads, [&](std::size_t i) {
    DeepJob& job = jobs_[i];
    try {
      spares.with([&](Buffers& buffers) {
        buffers.bytes.resize(job.entry.stored_bytes);
        file_.read(job.entry.offset, buffers.bytes);
        const Block block = parse_block(buffers.bytes, Kind::kLayer);
        decode_layer(read_layer_block(block), block.body, spaces_[job.space], buffers.layer);
      });
    } catch (const Error& e) {
      if (!tells_of_file(e)) throw;
      job.error = e;
    }
  });
  for (const DeepJob& job : jobs_) {
    ++report.decoded_layers;
    if (!job.error) continue;
    const PatchIndex patch{job.entry.ix, job.entry.iy};
    if (Seen* seen = find(job.entry.offset)) seen->told = true;
    problem(job.entry.offset, name_of(patch, job.layer) + ": " + job.error->message(), patch, job.layer);
  }
  jobs_.clear();
  check_cancelled();
}

}  // namespace apgm::format
