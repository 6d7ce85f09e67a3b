#include "archive_merge.hpp"

#include <algorithm>
#include <compare>
#include <set>
#include <string>
#include <string_view>

#include "apgm/core/error.hpp"
#include "file_cursor.hpp"
#include "located.hpp"

namespace apgm::format {
namespace {

void check_order(const std::vector<MapChanges::Gone>& gone) {
  const auto place = [](const MapChanges::Gone& g) {
    return std::pair<std::uint64_t, const std::string&>(curve_key(g.patch), g.layer);
  };
  for (std::size_t i = 1; i < gone.size(); ++i) {
    if (place(gone[i - 1]) < place(gone[i])) continue;
    throw Error(ErrorCode::kInvalidArgument, "what is gone is not in order");
  }
}

}  // namespace

ArchiveMerge::ArchiveMerge(CommitTarget& target, const MapHeader& header, std::vector<MapChanges::Gone> gone)
    : target_(target),
      types_(header.types),
      commit_(target, target.base() == nullptr ? 1 : target.base()->at.footer.commits + 1, header),
      gone_(std::move(gone)) {
  check_order(gone_);
  const OpenCommit* base = target.base();
  if (base != nullptr && !(base->header.frame == header.frame)) {
    throw Error(ErrorCode::kIncompatible, "the map has another frame than the archive '" +
                                              target.input()->path() +
                                              "': " + difference(header.frame, base->header.frame))
        .hint("all commits need the same datum, patch edge, EPSG code and frame id")
        .at(target.input()->path());
  }
  rank_types(base == nullptr ? TypeTable() : base->header.types, types_);
  commit_.write_header();
}

void ArchiveMerge::rank_types(const TypeTable& before, const TypeTable& after) {
  std::set<std::string> names;
  for (const auto* table : {&before, &after}) {
    for (const LayerType& type : *table) names.insert(type.name);
  }
  const std::vector<std::string> all(names.begin(), names.end());
  const auto rank = [&](const LayerType& type) {
    return static_cast<std::size_t>(std::ranges::lower_bound(all, type.name) - all.begin());
  };
  for (const LayerType& type : after) new_ranks_.push_back(rank(type));
  for (const LayerType& type : before) {
    old_ranks_.push_back(rank(type));
    const auto found = after.find(type.name);
    const bool same = found && type.same_meaning(after[*found]);
    new_types_.push_back(same ? std::optional<TypeId>(*found) : std::nullopt);
  }
}

/// The next entry of the last commit; nullptr at its end.
const IndexEntry* ArchiveMerge::head() {
  const OpenCommit* base = target_.base();
  if (base == nullptr) return nullptr;
  if (entry_ < entries_.size()) return &entries_[entry_];
  if (page_ == base->root.pages.size()) return nullptr;
  const fbs::PageRef& ref = base->root.pages[page_++];
  const InputFile& file = *target_.input();
  const auto before = entries_.empty() ? std::optional<Place>() : place_of(entries_.back());
  buffer_.resize(ref.bytes());
  file.read(ref.offset(), buffer_);
  located(file, ref.offset(), "", [&] {
    read_page(buffer_, ref, base->at.footer.root_offset, base->header.types, base->root, entries_);
    if (before && place_of(entries_.front()) <= *before) {
      throw Error(ErrorCode::kDamaged, "index entries are not in order");
    }
  });
  commit_.start_page(ref);
  entry_ = 0;
  return &entries_.front();
}

bool ArchiveMerge::is_gone(std::uint64_t key, const std::string& layer) {
  for (; gone_at_ < gone_.size(); ++gone_at_) {
    const MapChanges::Gone& g = gone_[gone_at_];
    const auto order =
        std::pair(curve_key(g.patch), std::string_view(g.layer)) <=> std::pair(key, std::string_view(layer));
    if (order >= 0) return order == 0;
  }
  return false;
}

void ArchiveMerge::keep(const IndexEntry& entry) {
  const std::string& name = target_.base()->header.types[entry.type].name;
  const std::optional<TypeId> type = new_types_[entry.type];
  if (!type || is_gone(entry.key, name)) return commit_.touch();
  if (*type == entry.type) return commit_.add_stored(entry);
  const PatchIndex patch{entry.ix, entry.iy};
  const LayerInfo info{patch,          entry.type,         entry.step,
                       entry.encoding, entry.stored_bytes, entry.content_hash,
                       entry.stamp_ns, entry.offset};
  Parcel parcel;
  parcel.patch = patch;
  parcel.type = *type;
  parcel.stamp_ns = entry.stamp_ns;
  parcel.state = Parcel::State::kStored;
  located(
      *target_.input(), entry.offset, name_of(patch, name),
      [&] { read_stored(*target_.input(), info, parcel.stored); }, kSalvage);
  commit_.add(parcel);
  ++layers_written_;
}

void ArchiveMerge::keep_until(const std::optional<Place>& end) {
  for (const IndexEntry* entry = head(); entry != nullptr && (!end || place_of(*entry) < *end);
       entry = head()) {
    keep(*entry);
    ++entry_;
  }
}

void ArchiveMerge::put(std::span<const Parcel> parcels) {
  for (const Parcel& parcel : parcels) {
    const Place place{curve_key(parcel.patch), new_ranks_[parcel.type]};
    keep_until(place);
    const IndexEntry* entry = head();
    if (entry != nullptr && place_of(*entry) == place) {
      ++entry_;
      commit_.touch();
    }
    if (parcel.state == Parcel::State::kNothing) continue;
    commit_.add(parcel);
    ++layers_written_;
  }
}

Footer ArchiveMerge::finish() {
  keep_until(std::nullopt);
  const OpenCommit* base = target_.base();
  Footer footer = base == nullptr ? commit_.finish() : commit_.finish(&base->at.footer, &base->root);
  if (base != nullptr) footer.previous_footer = base->at.offset;
  target_.close(footer_block(footer));
  return footer;
}

}  // namespace apgm::format
