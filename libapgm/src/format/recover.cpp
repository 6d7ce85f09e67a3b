#include "apgm/format/recover.hpp"

#include <algorithm>
#include <functional>
#include <utility>

#include "commits.hpp"
#include "content_id.hpp"
#include "footer.hpp"
#include "layer_block.hpp"
#include "located.hpp"
#include "map_header.hpp"
#include "parallel.hpp"
#include "preamble.hpp"
#include "recover_plan.hpp"
#include "recover_strays.hpp"
#include "scan.hpp"

namespace apgm {

using namespace format;

namespace {

/// Layers that are decoded before the caller hears of progress again.
constexpr std::size_t kBatch = 4096;

/// What the preamble says; nullopt if it is lost.
std::optional<bool> stated_archive(const InputFile& file) {
  try {
    return is_archive(read_preamble(file));
  } catch (const Error& e) {
    if (e.code() != ErrorCode::kDamaged && e.code() != ErrorCode::kForeign) throw;
    return {};
  }
}

/// Where the last commit ends; the file's end if that is not to be known.
std::uint64_t committed_end(const InputFile& file, bool archive, RecoverReport& report) {
  try {
    report.uncommitted_bytes = find_last_footer(file, archive).uncommitted_bytes;
  } catch (const Error& e) {
    if (e.code() == ErrorCode::kUnreadable) throw;
  }
  return file.size() - report.uncommitted_bytes;
}

/// What is whole behind the last commit of an archive.
struct Unfinished {
  std::uint64_t layers = 0;
  bool index = false;  // its root: but for the footer the commit was finished
};

Unfinished look_behind(const InputFile& file, std::uint64_t from,
                       const std::function<void(std::uint64_t)>& progress) {
  constexpr std::uint64_t kProgressBytes = std::uint64_t{16} << 20;
  Unfinished out;
  BlockScan scan(file, from, file.size());
  Spot spot;
  std::uint64_t told = from;
  while (scan.next(spot)) {
    const bool whole = spot.state == Spot::State::kWhole;
    out.layers += whole && spot.header.kind == Kind::kLayer;
    out.index |= whole && spot.header.kind == Kind::kIndexRoot;
    if (spot.offset + spot.bytes - told < kProgressBytes) continue;
    told = spot.offset + spot.bytes;
    progress(told);
  }
  return out;
}

class RecoveryCursor final : public PatchCursor {
 public:
  RecoveryCursor(const std::vector<Chosen>& layers, const std::optional<PatchRange>& range)
      : layers_(layers), range_(range) {}

  bool next(PatchInfo& out) override {
    out.layers.clear();
    for (; at_ < layers_.size(); ++at_) {
      LayerInfo info = layers_[at_].info;
      if (range_ && !range_->contains(info.patch)) continue;
      if (!out.layers.empty() && info.patch != out.patch) return true;
      out.patch = info.patch;
      info.locator = at_;
      out.layers.push_back(info);
    }
    return !out.layers.empty();
  }

 private:
  const std::vector<Chosen>& layers_;
  std::optional<PatchRange> range_;
  std::size_t at_ = 0;
};

}  // namespace

struct Recovery::State {
  template <typename... Input>
  explicit State(const RecoverOptions& recover_options, Input&&... input)
      : options(recover_options),
        file(std::forward<Input>(input)...),
        salvage(file),
        plan(file, salvage, options, report) {}

  RecoverOptions options;
  InputFile file;
  RecoverReport report;
  Salvage salvage;
  RecoverPlan plan;
  Summary summary;

  void tell(std::uint64_t done) const {
    plan.check_cancelled();
    check_list(options.max_memory_bytes, salvage.memory_bytes(), done, file.size());
    if (options.progress) options.progress(done, 2 * file.size());
  }

  void run() {
    const auto progress = [&](std::uint64_t done) { tell(done); };
    const std::optional<bool> archive = stated_archive(file);
    const std::uint64_t end = committed_end(file, archive.value_or(false), report);
    salvage.scan(end, progress);
    check_any();
    mark_strays(salvage, archive);
    leave_out_unfinished(end, progress);
    plan.make();
    test_layers();
    plan.tell_losses();
    report.layers = plan.layers.size();
    report.repaired = salvage.repaired;
    std::ranges::stable_sort(report.losses, {}, &Loss::offset);
    finish_header();
    sum_up();
  }

  /// A commit without its footer is none; but it may be a whole one whose footer was lost.
  void leave_out_unfinished(std::uint64_t end, const std::function<void(std::uint64_t)>& progress) {
    if (end == file.size()) return;
    const Unfinished behind = look_behind(file, end, progress);
    report.uncommitted_layers = behind.layers;
    if (behind.layers == 0 && !behind.index) return;
    plan.lose(end, "a commit that was not finished, " + std::to_string(behind.layers) +
                       (behind.layers == 1 ? " layer" : " layers") + ", is left out");
  }

  void check_any() const {
    const bool any = !salvage.headers.empty() || !salvage.layers.empty() || !salvage.footers.empty() ||
                     !salvage.roots.empty() || !salvage.pages.empty();
    if (any) return;
    read_preamble(file);  // says what it is instead
    fail_damaged(file, 0, "not one block in it is whole");
  }

  /// Layers that do not decode are lost.
  void test_layers() {
    std::vector<std::string> faults(plan.layers.size());
    std::uint64_t largest = 0;
    for (const Chosen& chosen : plan.layers) {
      if (chosen.info.step > kMaxStep) continue;  // does not decode
      const std::uint64_t bytes = value_bytes(plan.header.types[chosen.info.type], chosen.info.step);
      largest = std::max(largest, std::min<std::uint64_t>(bytes, Layer::kMaxBytes));
    }
    const int threads =
        decoding_threads(options.max_memory_bytes, salvage.memory_bytes(), largest, options.threads);
    Spares<Layer> spares;
    for (std::size_t from = 0; from < plan.layers.size(); from += kBatch) {
      const std::size_t n = std::min(kBatch, plan.layers.size() - from);
      parallel_for(n, threads, [&](std::size_t i) {
        faults[from + i] = spares.with([&](Layer& layer) { return fault_of(plan.layers[from + i], layer); });
      });
      tell(file.size() + file.size() * (from + n) / plan.layers.size());
    }
    std::size_t kept = 0;
    for (std::size_t i = 0; i < plan.layers.size(); ++i) {
      const LayerInfo& info = plan.layers[i].info;
      const std::string& layer = plan.header.types[info.type].name;
      if (faults[i].empty()) {
        plan.layers[kept++] = plan.layers[i];
      } else if (plan.counts_only()) {
        plan.count_loss();
      } else {
        plan.lose(info.locator, name_of(info.patch, layer) + ": " + faults[i], info.patch, layer);
      }
    }
    plan.layers.resize(kept);
  }

  std::string fault_of(const Chosen& chosen, Layer& layer) const {
    try {
      load(chosen, layer);
      return {};
    } catch (const Error& e) {
      if (e.code() == ErrorCode::kUnreadable) throw;
      return e.message();
    }
  }

  void load(const Chosen& chosen, Layer& out) const {
    const std::vector<std::byte> bytes = salvage.block(chosen.info.locator, chosen.info.stored_bytes);
    const Block block = parse_block(bytes, Kind::kLayer);
    const LayerBlock layer = read_layer_block(block);
    if (layer.info.encoding != chosen.info.encoding || layer.info.content_hash != chosen.info.content_hash) {
      throw Error(ErrorCode::kDamaged, "the block has changed");
    }
    decode_layer(layer, block.body, plan.header.types[chosen.info.type], out);
  }

  void load_stored(const Chosen& chosen, StoredLayer& out) const {
    const std::vector<std::byte> bytes = salvage.block(chosen.info.locator, chosen.info.stored_bytes);
    const Block block = parse_block(bytes, Kind::kLayer);
    const LayerBlock layer = read_layer_block(block);
    out.encoding = layer.info.encoding;
    out.step = layer.info.step;
    out.content_hash = layer.info.content_hash;
    out.error_bound = layer.error_bound;
    out.bytes.assign(block.body.begin(), block.body.end());
  }

  void finish_header() {
    MapHeader& header = plan.header;
    strip_archive_keys(header);
    if (header.history.size() >= kMaxHistory) return;
    Provenance step{"recover", {}, "{\"losses\":" + std::to_string(report.loss_count) + "}"};
    if (const std::string id = plan.stated_id(); !id.empty()) step.inputs.push_back(id);
    header.history.push_back(std::move(step));
  }

  void sum_up() {
    summary.types.resize(plan.header.types.size());
    for (std::size_t i = 0; i < plan.layers.size(); ++i) {
      const Chosen& chosen = plan.layers[i];
      if (i == 0 || plan.layers[i - 1].key != chosen.key) ++summary.patches;
      summary.range.add(chosen.info.patch);
      Summary::OfType& of = summary.types[chosen.info.type];
      ++of.layers;
      ++of.layers_at[chosen.info.step];
      of.stored_bytes += chosen.info.stored_bytes;
      of.raw_bytes += value_bytes(plan.header.types[chosen.info.type], chosen.info.step);
    }
  }

  template <typename Work>
  auto at_layer(const LayerInfo& info, Work work) const {
    const Chosen& chosen = plan.layers[info.locator];
    return located(file, chosen.info.locator, name_of(info.patch, plan.header.types[info.type].name),
                   [&] { return work(chosen); });
  }
};

Recovery::Recovery(const std::string& path, const RecoverOptions& options)
    : state_(std::make_unique<State>(options, path)) {
  state_->run();
}
Recovery::Recovery(std::span<const std::byte> bytes, const RecoverOptions& options)
    : state_(std::make_unique<State>(options, bytes, "message")) {
  state_->run();
}
Recovery::~Recovery() = default;

const RecoverReport& Recovery::report() const { return state_->report; }
const MapHeader& Recovery::header() const { return state_->plan.header; }
Summary Recovery::summary() const { return state_->summary; }

std::unique_ptr<PatchCursor> Recovery::patches(const std::optional<PatchRange>& range) const {
  return std::make_unique<RecoveryCursor>(state_->plan.layers, range);
}

void Recovery::load(const LayerInfo& info, Layer& out) const {
  state_->at_layer(info, [&](const Chosen& chosen) { state_->load(chosen, out); });
}

bool Recovery::load_stored(const LayerInfo& info, StoredLayer& out) const {
  state_->at_layer(info, [&](const Chosen& chosen) { state_->load_stored(chosen, out); });
  return true;
}

}  // namespace apgm
