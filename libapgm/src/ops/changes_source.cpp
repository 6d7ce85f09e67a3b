#include "apgm/ops/changes_source.hpp"

#include <utility>

#include "apgm/core/error.hpp"
#include "lockstep.hpp"
#include "quoted.hpp"
#include "totals.hpp"
#include "type_twins.hpp"

namespace apgm {
namespace {

/// Which layers of a source are meant, by their place in its walk: a bit a layer.
class Selection {
 public:
  void add(bool chosen) { chosen_.push_back(chosen); }
  bool at(std::uint64_t place) const { return place < chosen_.size() && chosen_[place]; }

 private:
  std::vector<bool> chosen_;
};

class ChangesCursor final : public PatchCursor {
 public:
  ChangesCursor(const PatchSource& source, const Selection& changed, const std::optional<PatchRange>& range)
      : changed_(changed), range_(range), cursor_(source.patches()) {}

  bool next(PatchInfo& out) override {
    while (cursor_->next(out)) {
      // Places count through patches outside the range, too.
      const std::uint64_t first = place_;
      place_ += out.layers.size();
      if (range_ && !range_->contains(out.patch)) continue;
      std::uint64_t place = first;
      std::erase_if(out.layers, [&](const LayerInfo&) { return !changed_.at(place++); });
      if (!out.layers.empty()) return true;
    }
    return false;
  }

 private:
  const Selection& changed_;
  std::optional<PatchRange> range_;
  std::unique_ptr<PatchCursor> cursor_;
  std::uint64_t place_ = 0;
};

}  // namespace

struct ChangesSource::State {
  enum class Verdict : std::uint8_t { kEqual, kChanged, kGone };

  State(const PatchSource& base_source, const PatchSource& other_source)
      : base(base_source),
        other(other_source),
        to_base(ops::type_twins(other.header().types, base.header().types)) {
    summary.types.resize(other.header().types.size());
  }

  const PatchSource& base;
  const PatchSource& other;
  std::vector<ops::TypeTwin> to_base;  ///< by type of the other
  Selection changed;
  std::vector<MapChanges::Gone> gone;
  Summary summary;
  Layer base_cells, other_cells;

  void walk(const RunOptions& run);
  void compare_patch(const ops::Lockstep& at);
  Verdict verdict(const LayerInfo& info, std::span<const LayerInfo> base_layers);
};

void ChangesSource::State::walk(const RunOptions& run) {
  const std::uint64_t total = base.summary().patches + other.summary().patches;
  std::uint64_t done = 0;
  for (ops::Lockstep at(base, "base", other, "other"); at.next();) {
    if (run.cancel != nullptr && run.cancel->load(std::memory_order_relaxed)) {
      throw Error(ErrorCode::kCancelled, "cancelled");
    }
    compare_patch(at);
    done += static_cast<std::uint64_t>(!at.left().empty()) + static_cast<std::uint64_t>(!at.right().empty());
    if (run.progress) run.progress(done, total);
  }
  base_cells = {};
  other_cells = {};
}

void ChangesSource::State::compare_patch(const ops::Lockstep& at) {
  bool any = false;
  std::vector<bool> lost(at.left().size(), true);
  for (const LayerInfo& info : at.right()) {
    const Verdict found = verdict(info, at.left());
    changed.add(found == Verdict::kChanged);
    if (found == Verdict::kChanged) ops::add_layer(info, other.header().types, summary);
    any |= found == Verdict::kChanged;
    const auto twin = to_base[info.type].type;
    const LayerInfo* before = twin ? ops::find_layer(at.left(), *twin) : nullptr;
    if (before != nullptr && found != Verdict::kGone)
      lost[static_cast<std::size_t>(before - at.left().data())] = false;
  }
  for (std::size_t i = 0; i < lost.size(); ++i) {
    if (lost[i]) gone.push_back({at.patch(), base.header().types[at.left()[i].type].name});
  }
  if (!any) return;
  ++summary.patches;
  summary.range.add(at.patch());
}

ChangesSource::State::Verdict ChangesSource::State::verdict(const LayerInfo& info,
                                                            std::span<const LayerInfo> base_layers) {
  const ops::TypeTwin& twin = to_base[info.type];
  const LayerInfo* before = twin.type ? ops::find_layer(base_layers, *twin.type) : nullptr;
  if (before == nullptr || !twin.same_meaning) return Verdict::kChanged;
  if (info.content_hash != 0 && before->content_hash != 0) {
    const bool same = info.content_hash == before->content_hash && info.step == before->step &&
                      info.stamp_ns == before->stamp_ns;
    return same ? Verdict::kEqual : Verdict::kChanged;
  }
  const LayerType& type = other.header().types[info.type];
  other.load(info, other_cells);
  // Maps in memory may hold layers without data, which no sink keeps.
  canonicalise(other_cells, type);
  if (is_vacuous(other_cells, type)) return Verdict::kGone;
  if (info.stamp_ns != before->stamp_ns) return Verdict::kChanged;
  base.load(*before, base_cells);
  canonicalise(base_cells, type);
  return same_cells(base_cells, other_cells) ? Verdict::kEqual : Verdict::kChanged;
}

ChangesSource::ChangesSource(const PatchSource& base, const PatchSource& other, const RunOptions& run,
                             const ChangesNames& names)
    : state_(std::make_unique<State>(base, other)) {
  if (base.header().frame != other.header().frame) {
    throw Error(ErrorCode::kIncompatible, ops::quoted(names.other) + " has another frame than " +
                                              ops::quoted(names.base) + ": " +
                                              difference(other.header().frame, base.header().frame))
        .hint("both need the same datum, patch edge, EPSG code and frame id");
  }
  state_->walk(run);
}

ChangesSource::~ChangesSource() = default;

const std::vector<MapChanges::Gone>& ChangesSource::gone() const { return state_->gone; }
bool ChangesSource::empty() const { return state_->summary.patches == 0 && state_->gone.empty(); }
const MapHeader& ChangesSource::header() const { return state_->other.header(); }
Summary ChangesSource::summary() const { return state_->summary; }

std::unique_ptr<PatchCursor> ChangesSource::patches(const std::optional<PatchRange>& range) const {
  return std::make_unique<ChangesCursor>(state_->other, state_->changed, range);
}

void ChangesSource::load(const LayerInfo& info, Layer& out) const { state_->other.load(info, out); }

bool ChangesSource::load_stored(const LayerInfo& info, StoredLayer& out) const {
  return state_->other.load_stored(info, out);
}

std::uint64_t ChangesSource::working_bytes(std::uint64_t layer_bytes) const {
  return apgm::working_bytes(state_->other, layer_bytes);
}

}  // namespace apgm
