#include "recover_plan.hpp"

#include <algorithm>
#include <iterator>
#include <map>
#include <tuple>
#include <unordered_map>

#include "content_id.hpp"
#include "located.hpp"

namespace apgm::format {
namespace {

Chosen chosen(const FoundLayer& layer, std::uint16_t type) {
  Chosen c{layer.info, layer.key, layer.commit};
  c.info.type = type;
  return c;
}

auto order_of(const Chosen& c) { return std::pair(c.key, c.info.type); }

auto place_of(const FoundLayer& l) {
  return std::tuple(l.key, l.info.type, l.payload_hash, l.commit, l.info.locator);
}

}  // namespace

void RecoverPlan::make() {
  find_newest();
  find_headers();
  if (!find_root()) use_header_alone();
  report_.index = root_.has_value() && root_commit_ == newest_;
  std::ranges::sort(salvage_.layers, {}, place_of);
  std::ranges::sort(salvage_.broken, {}, &Broken::offset);
  read_tables();
  if (root_) take_index();
  if (root_ && is_index_of_few()) forget_index();
  take_unindexed();
  // An unindexed layer replaces the one of the index: it is newer.
  std::ranges::stable_sort(unindexed_, {}, order_of);
  const std::vector<Chosen> indexed = std::move(layers);
  layers.clear();
  layers.reserve(indexed.size() + unindexed_.size());
  std::ranges::merge(unindexed_, indexed, std::back_inserter(layers), {}, order_of, order_of);
  const auto same = [](const Chosen& a, const Chosen& b) { return order_of(a) == order_of(b); };
  layers.erase(std::unique(layers.begin(), layers.end(), same), layers.end());
  count_left_out();
}

/// Of an archive layers of older states are left out rightly.
void RecoverPlan::count_left_out() {
  std::optional<std::uint64_t> key;
  std::vector<std::uint64_t> taken;  // content hashes, of the patch
  for (const FoundLayer& found : salvage_.layers) {
    if (!salvage_.sealed && !found.stray) continue;
    if (key != found.key) {
      key = found.key;
      taken.clear();
      auto c = std::ranges::lower_bound(layers, found.key, {}, &Chosen::key);
      for (; c != layers.end() && c->key == found.key; ++c) taken.push_back(c->info.content_hash);
      std::ranges::sort(taken);
    }
    if (std::ranges::binary_search(taken, found.info.content_hash)) continue;
    if (left_out_++ == 0) first_left_out_ = &found;
  }
}

/// A footer that does not lie where it says may have come with a page of another map, whose header is the
/// same.
bool RecoverPlan::is_index_of_few() const {
  if (!salvage_.sealed || footer_in_place_) return false;
  const auto found = std::ranges::count(salvage_.layers, false, &FoundLayer::stray);
  return 2 * layers.size() < static_cast<std::size_t>(found);
}

void RecoverPlan::forget_index() {
  root_.reset();
  footer_.reset();
  layers.clear();
  lost_entries_.clear();
  lost_pages_.clear();
  report_.index = false;
}

void RecoverPlan::take_index() {
  constexpr std::uint64_t kAnywhere = std::uint64_t{1} << 62;
  std::unordered_map<std::uint64_t, FoundBlock> pages;
  for (const FoundBlock& page : salvage_.pages) pages.emplace(page.payload_hash, page);
  std::vector<IndexEntry> entries;
  for (const fbs::PageRef& ref : root_->pages) {
    check_cancelled();
    const auto page = pages.find(ref.hash());
    try {
      if (page == pages.end()) throw Error(ErrorCode::kDamaged, "the page is lost");
      read_page(salvage_.block(page->second.offset, page->second.bytes), ref, kAnywhere, header.types, *root_,
                entries);
      if (!layers.empty() && order_of(layers.back()) >= Order(entries.front().key, entries.front().type)) {
        throw Error(ErrorCode::kDamaged, "the page is out of order");
      }
      for (const IndexEntry& entry : entries) take_entry(entry);
    } catch (const Error& e) {
      if (e.code() == ErrorCode::kUnreadable) throw;
      lost_pages_.push_back({ref.offset(), ref.first_key(), ref.last_key(), ref.entries()});
    }
  }
}

void RecoverPlan::take_entry(const IndexEntry& e) {
  const auto first = std::tuple(e.key, e.type, e.stored_hash, std::uint64_t{0}, std::uint64_t{0});
  const auto at = std::ranges::lower_bound(salvage_.layers, first, {}, place_of);
  if (at != salvage_.layers.end() && at->key == e.key && at->info.type == e.type &&
      at->payload_hash == e.stored_hash) {
    layers.push_back(chosen(*at, e.type));
  } else {
    lost_entries_.push_back({{e.key, e.type}, {e.ix, e.iy}, e.offset, {}});
  }
}

bool RecoverPlan::in_lost_page(std::uint64_t key) const {
  // Pages ascend, and so do those that are lost.
  const auto after = std::ranges::upper_bound(lost_pages_, key, {}, &LostPage::first_key);
  for (auto page = after; page != lost_pages_.begin();) {
    --page;
    if (key <= page->last_key) return true;
    if (page->first_key != page->last_key) break;
  }
  return false;
}

/// What no index names: all without one, what is newer than it, and what stood in a page that is lost.
void RecoverPlan::take_unindexed() {
  find_older_states();
  const std::vector<FoundLayer>& found = salvage_.layers;
  for (std::size_t from = 0, to = 0; from < found.size(); from = to) {
    for (to = from; to < found.size() && found[to].key == found[from].key; ++to) {
    }
    take_group(from, to);
  }
}

/// The layers of one patch.
void RecoverPlan::take_group(std::size_t from, std::size_t to) {
  const std::vector<FoundLayer>& found = salvage_.layers;
  const std::uint64_t key = found[from].key;
  bool wanted =
      !root_ || in_lost_page(key) ||
      std::ranges::binary_search(lost_entries_, key, {}, [](const LostEntry& e) { return e.order.first; });
  for (std::size_t i = from; i < to && !wanted; ++i)
    wanted = !found[i].stray && found[i].commit > root_commit_;
  if (!wanted) return;
  std::map<std::uint16_t, const FoundLayer*> newest;
  for (std::size_t i = from; i < to; ++i) {
    if (!may_be_taken(found[i])) continue;
    const auto type = type_in_map(found[i]);
    if (!type) continue;
    const FoundLayer*& best = newest[*type];
    const auto age = [](const FoundLayer& l) { return std::pair(l.commit, l.info.locator); };
    if (best == nullptr || age(*best) < age(found[i])) best = &found[i];
  }
  for (const auto& [type, layer] : newest) add_unindexed(*layer, type);
}

/// An index says what the map holds of a patch. In place of what is lost of that counts only what an earlier
/// index of the archive named.
bool RecoverPlan::may_be_taken(const FoundLayer& layer) const {
  if (layer.stray) return false;
  if (!root_ || layer.commit > root_commit_ || in_lost_page(layer.key)) return true;
  return older_states_.contains(layer.payload_hash);
}

void RecoverPlan::find_older_states() {
  if (salvage_.sealed || lost_entries_.empty()) return;
  const auto key = [](const LostEntry& e) { return e.order.first; };
  std::vector<IndexEntry> entries;
  for (const FoundBlock& page : salvage_.pages) {
    if (page.stray) continue;
    check_cancelled();
    try {
      unpack_page(salvage_.block(page.offset, page.bytes), entries);
    } catch (const Error& e) {
      if (e.code() == ErrorCode::kUnreadable) throw;
      continue;
    }
    for (const IndexEntry& e : entries) {
      if (std::ranges::binary_search(lost_entries_, e.key, {}, key)) older_states_.insert(e.stored_hash);
    }
  }
}

void RecoverPlan::add_unindexed(const FoundLayer& layer, std::uint16_t type) {
  const Order order(layer.key, type);
  if (!root_ || layer.commit > root_commit_) return unindexed_.push_back(chosen(layer, type));
  if (std::ranges::binary_search(layers, order, {}, order_of)) return;
  const auto lost = std::ranges::lower_bound(lost_entries_, order, {}, &LostEntry::order);
  const bool was_named = lost != lost_entries_.end() && lost->order == order;
  if (was_named) lost->kept_commit = layer.commit;
  if (was_named || in_lost_page(layer.key)) unindexed_.push_back(chosen(layer, type));
}

/// What is broken does not overlap.
std::string RecoverPlan::why_missing(std::uint64_t offset) const {
  const auto after = std::ranges::upper_bound(salvage_.broken, offset, {}, &Broken::offset);
  if (after != salvage_.broken.begin()) {
    const Broken& b = *std::prev(after);
    if (offset - b.offset < b.bytes) return b.why;
  }
  return offset >= file_.size() ? "the file ends before it" : "its block is not there";
}

void RecoverPlan::check_cancelled() const {
  if (options_.cancel != nullptr && options_.cancel->load(std::memory_order_relaxed)) {
    throw Error(ErrorCode::kCancelled, "cancelled");
  }
}

void RecoverPlan::lose(std::uint64_t offset, std::string text, std::optional<PatchIndex> patch,
                       std::string layer) {
  count_loss();
  if (report_.losses.size() < options_.max_losses) {
    report_.losses.push_back({std::move(text), offset, patch, std::move(layer)});
  }
}

/// The newest footer states a hash over all layers, and the frame.
bool RecoverPlan::has_stated_id() const {
  ContentId id(header);
  for (const Chosen& c : layers) id.add(c.info.patch, c.info.type, c.info.step, c.info.content_hash);
  return id.value() == footer_->content_id;
}

/// A header that was given in place of a lost one is tried by the hash over all layers, if these are there.
void RecoverPlan::check_given_header() const {
  if (!header_is_given_ || !has_all_layers() || !unindexed_.empty() || has_stated_id()) return;
  throw Error(ErrorCode::kIncompatible, "the header that was given is not that of '" + file_.path() +
                                            "': frame or layer types are others")
      .hint(
          "all layers are whole, and the content id in the footer tells; give a map of the same frame and "
          "types");
}

void RecoverPlan::tell_losses() {
  check_given_header();
  for (const LostEntry& entry : lost_entries_) {
    if (counts_only()) {
      count_loss();
      continue;
    }
    const std::string& layer = header.types[entry.order.second].name;
    std::string text = name_of(entry.patch, layer) + ": " + why_missing(entry.offset);
    if (entry.kept_commit) text += "; its state of commit " + std::to_string(*entry.kept_commit) + " is kept";
    lose(entry.offset, std::move(text), entry.patch, layer);
  }
  check_cancelled();
  if (!has_all_layers() || !has_stated_id()) tell_unlisted();
  if (left_out_ > 0) {
    const PatchIndex patch = first_left_out_->info.patch;
    lose(first_left_out_->info.locator,
         std::to_string(left_out_) + " whole " + (left_out_ == 1 ? "layer is" : "layers are") +
             " left out, the first of patch (" + std::to_string(patch.x) + "," + std::to_string(patch.y) +
             "): nothing says that they are of this map");
  }
}

/// Layers that no index names, so that only their remains tell of them.
void RecoverPlan::tell_unlisted() {
  const bool has_index = root_ && root_commit_ == newest_;
  if (has_index && lost_pages_.empty()) return;
  for (const Broken& b : salvage_.broken) {
    if (b.kind != Kind::kLayer || b.bytes == 0) continue;
    if (has_index && !in_lost_page(b.key)) continue;
    if (counts_only()) {
      count_loss();
      continue;
    }
    const PatchIndex patch = patch_of_key(b.key);
    lose(b.offset,
         "a layer of patch (" + std::to_string(patch.x) + "," + std::to_string(patch.y) + "): " + b.why,
         patch);
  }
  for (const Broken& b : salvage_.broken) {
    if (b.kind == Kind{}) lose(b.offset, std::to_string(b.bytes) + " bytes that hold no whole block");
  }
  const auto layers_text = [](std::uint64_t n) {
    return std::to_string(n) + (n == 1 ? " layer" : " layers");
  };
  const std::string taken =
      unindexed_.empty() ? "" : "; " + layers_text(unindexed_.size()) + " that nothing vouches for are taken";
  if (has_index) {
    const std::size_t n = lost_pages_.size();
    lose(lost_pages_.front().offset, std::to_string(n) + (n == 1 ? " page" : " pages") +
                                         " of the index: layers that nothing else named may be lost too" +
                                         taken);
  } else {
    lose(file_.size(), "the index of commit " + std::to_string(newest_) +
                           ": layers that only it named may be lost too, some may have been dropped by it" +
                           taken);
  }
}

}  // namespace apgm::format
