#include "apgm/ops/apply.hpp"

#include <algorithm>
#include <array>
#include <compare>
#include <utility>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/format/content_id.hpp"
#include "apgm/format/gone_list.hpp"
#include "lockstep.hpp"
#include "quoted.hpp"
#include "totals.hpp"
#include "type_twins.hpp"

namespace apgm {

using ops::quoted;

namespace {

constexpr const char* kBaseKey = "apgm.base";
constexpr const char* kResultKey = "apgm.result";
constexpr std::array kKeys{kBaseKey, kResultKey, kGoneKey};

[[noreturn]] void fail(ErrorCode code, const std::string& message, const std::string& hint = {}) {
  throw Error(code, message).hint(hint);
}

/// Takes a content id out of the metadata.
std::string take_id(MapHeader& header, const char* key, const ApplyNames& names) {
  const auto pair = header.metadata.extract(key);
  if (pair.empty()) {
    fail(ErrorCode::kForeign, quoted(names.delta) + " is not a delta: its metadata lack '" + key + "'",
         "'apgm-diff REF OTHER --delta FILE' makes one; whole maps are fused without --apply");
  }
  const std::string& id = pair.mapped();
  if (!is_content_id(id)) {
    fail(ErrorCode::kDamaged, quoted(names.delta) + " is damaged: '" + key + "' is not a content id");
  }
  return id;
}

std::string id_of(const PatchSource& source) {
  std::string id = source.content_id();
  return id.empty() ? content_id_of(source) : id;
}

/// Where a layer stands in the result.
struct Place {
  std::uint64_t key = 0;
  TypeId type = 0;
  bool gone = false;  ///< else the delta holds it

  friend bool operator==(const Place& a, const Place& b) { return a.key == b.key && a.type == b.type; }
  friend auto operator<=>(const Place& a, const Place& b) {
    return std::pair(a.key, a.type) <=> std::pair(b.key, b.type);
  }
};

}  // namespace

MapHeader delta_header(const ChangesSource& changes, const std::string& base_id,
                       const std::string& result_id) {
  MapHeader header = changes.header();
  if (holds_changes(header)) {
    fail(ErrorCode::kIncompatible, "the map to come to is itself a delta",
         "'apgm-merge --apply' makes a map of a delta and its base");
  }
  store_gone(gone_by_name(changes), header);
  header.metadata[kBaseKey] = base_id;
  header.metadata[kResultKey] = result_id;
  return header;
}

std::vector<MapChanges::Gone> gone_by_name(const ChangesSource& changes) {
  const TypeTable& types = changes.header().types;
  std::vector<MapChanges::Gone> gone;
  std::ranges::copy_if(changes.gone(), std::back_inserter(gone),
                       [&](const auto& g) { return types.find(g.layer).has_value(); });
  return gone;
}

bool holds_changes(const MapHeader& header) {
  return std::ranges::any_of(kKeys, [&](const char* key) { return header.metadata.contains(key); });
}

void drop_changes(MapHeader& header) {
  for (const char* key : kKeys) header.metadata.erase(key);
}

void check_base(const PatchSource& base, const std::string& base_id, const std::string& result_id,
                const ApplyNames& names) {
  const std::string own_id = id_of(base);
  if (own_id != base_id) {
    const bool done = own_id == result_id;
    fail(ErrorCode::kIncompatible,
         quoted(names.delta) + " is for another base: it is for content " + base_id + ", " +
             quoted(names.base) + " is content " + own_id,
         done ? "the map is already what the delta leads to" : "'apgm-info' tells the content id of a map");
  }
  if (holds_changes(base.header())) {
    fail(ErrorCode::kIncompatible, quoted(names.base) + " is itself a delta",
         "apply it to its own base first: --apply takes several deltas, in their order");
  }
}

struct AppliedSource::State {
  State(const PatchSource& base_source, const PatchSource& delta_source)
      : base(base_source), delta(delta_source), header(delta.header()) {}

  const PatchSource& base;
  const PatchSource& delta;
  MapHeader header;
  std::string result_id;
  std::vector<std::optional<TypeId>> to_result, to_base;
  std::vector<Place> places;  ///< ascending: what is not as in the base
  Summary summary;

  void open(const ApplyNames& names);
  void match_types();
  void take_places(const std::vector<MapChanges::Gone>& gone, const ApplyNames& names);
  const Place* find(PatchIndex patch, TypeId type) const;
  bool in_delta(const LayerInfo& info) const;
  LayerInfo base_info(LayerInfo info) const;
};

/// Walks base and delta side by side.
class AppliedCursor final : public PatchCursor {
 public:
  AppliedCursor(const AppliedSource::State& state, const std::optional<PatchRange>& range)
      : state_(state), at_(state.base, "base", state.delta, "delta", range) {}

  bool next(PatchInfo& out) override {
    while (at_.next()) {
      out.patch = at_.patch();
      out.layers.assign(at_.right().begin(), at_.right().end());
      for (const LayerInfo& info : at_.left()) {
        const auto type = state_.to_result[info.type];
        if (!type || state_.find(info.patch, *type) != nullptr) continue;
        out.layers.push_back(info);
        out.layers.back().type = *type;
      }
      std::ranges::sort(out.layers, {}, &LayerInfo::type);
      if (!out.layers.empty()) return true;
    }
    return false;
  }

 private:
  const AppliedSource::State& state_;
  ops::Lockstep at_;
};

void AppliedSource::State::open(const ApplyNames& names) {
  const std::string base_id = take_id(header, kBaseKey, names);
  result_id = take_id(header, kResultKey, names);
  check_base(base, base_id, result_id, names);
  if (header.frame != base.header().frame) {
    fail(ErrorCode::kIncompatible, quoted(names.delta) + " is for a map with another frame than " +
                                       quoted(names.base) + ": " +
                                       difference(header.frame, base.header().frame));
  }
  const std::vector<MapChanges::Gone> gone = take_gone(header);
  match_types();
  take_places(gone, names);
}

void AppliedSource::State::match_types() {
  to_base.resize(header.types.size());
  for (const ops::TypeTwin& twin : ops::type_twins(base.header().types, header.types)) {
    const auto own = static_cast<TypeId>(to_result.size());
    to_result.push_back(twin.same_meaning ? twin.type : std::nullopt);
    if (twin.same_meaning) to_base[*twin.type] = own;
  }
}

void AppliedSource::State::take_places(const std::vector<MapChanges::Gone>& gone, const ApplyNames& names) {
  for (const MapChanges::Gone& g : gone) {
    places.push_back({curve_key(g.patch), header.types.find(g.layer).value(), true});
  }
  PatchInfo patch;
  for (const auto cursor = delta.patches(); cursor->next(patch);) {
    for (const LayerInfo& info : patch.layers) places.push_back({curve_key(patch.patch), info.type, false});
  }
  std::ranges::sort(places);
  if (std::ranges::adjacent_find(places) != places.end()) {
    fail(ErrorCode::kDamaged, quoted(names.delta) + " is damaged: a layer is both changed and gone");
  }
}

const Place* AppliedSource::State::find(PatchIndex patch, TypeId type) const {
  const Place wanted{curve_key(patch), type, false};
  const auto it = std::ranges::lower_bound(places, wanted);
  return it != places.end() && *it == wanted ? &*it : nullptr;
}

bool AppliedSource::State::in_delta(const LayerInfo& info) const {
  const Place* place = find(info.patch, info.type);
  return place != nullptr && !place->gone;
}

LayerInfo AppliedSource::State::base_info(LayerInfo info) const {
  info.type = to_base[info.type].value();
  return info;
}

AppliedSource::AppliedSource(const PatchSource& base, const PatchSource& delta, const ApplyNames& names)
    : state_(std::make_unique<State>(base, delta)) {
  state_->open(names);
  state_->summary = totals_of(*this);
  const std::string id = content_id_of(*this);
  if (id == state_->result_id) return;
  fail(
      ErrorCode::kDamaged,
      quoted(names.delta) + " is not the delta it says it is: on " + quoted(names.base) +
          " it gives content " + id + ", not " + state_->result_id,
      "a part of a delta, or one changed, is none: take the one apgm-diff wrote; 'apgm-verify' tells whether "
      "a file is damaged");
}

AppliedSource::~AppliedSource() = default;

const MapHeader& AppliedSource::header() const { return state_->header; }
Summary AppliedSource::summary() const { return state_->summary; }
std::string AppliedSource::content_id() const { return state_->result_id; }

std::unique_ptr<PatchCursor> AppliedSource::patches(const std::optional<PatchRange>& range) const {
  return std::make_unique<AppliedCursor>(*state_, range);
}

void AppliedSource::load(const LayerInfo& info, Layer& out) const {
  const State& s = *state_;
  if (s.in_delta(info)) return s.delta.load(info, out);
  s.base.load(s.base_info(info), out);
}

bool AppliedSource::load_stored(const LayerInfo& info, StoredLayer& out) const {
  const State& s = *state_;
  return s.in_delta(info) ? s.delta.load_stored(info, out) : s.base.load_stored(s.base_info(info), out);
}

std::uint64_t AppliedSource::working_bytes(std::uint64_t layer_bytes) const {
  return std::max(apgm::working_bytes(state_->base, layer_bytes),
                  apgm::working_bytes(state_->delta, layer_bytes));
}

}  // namespace apgm
