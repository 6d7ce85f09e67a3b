#include "recover_strays.hpp"

#include <algorithm>
#include <tuple>
#include <unordered_set>
#include <utility>
#include <vector>

namespace apgm::format {
namespace {

constexpr std::uint64_t kHeaderPlace = sizeof(Preamble);

/// A block, where it stands.
struct Placed {
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;
  std::uint64_t commit = 0;
  Kind kind{};
  bool* stray = nullptr;
  const FoundLayer* layer = nullptr;
};

/// Marks what is not in a longest run of items of which each may stand before the next; of equal runs the one
/// that begins first is kept.
template <class MayPrecede>
void keep_longest_run(const std::vector<const Placed*>& items, MayPrecede may_precede) {
  constexpr std::size_t kNone = ~std::size_t{0};
  std::vector<std::size_t> last;  // of the best run of each length
  std::vector<std::size_t> before(items.size(), kNone);
  for (std::size_t i = 0; i < items.size(); ++i) {
    const auto at = std::ranges::partition_point(
        last, [&](std::size_t tail) { return may_precede(*items[tail], *items[i]); });
    if (at != last.begin()) before[i] = *std::prev(at);
    if (at == last.end()) {
      last.push_back(i);
    } else if (may_precede(*items[i], *items[*at])) {
      *at = i;
    }
  }
  for (const Placed* item : items) *item->stray = true;
  for (std::size_t i = last.empty() ? kNone : last.back(); i != kNone; i = before[i])
    *items[i]->stray = false;
}

class Strays {
 public:
  explicit Strays(Salvage& salvage) : salvage_(salvage) {
    const auto add = [&](auto& list, Kind kind) {
      for (FoundBlock& b : list) items_.push_back({b.offset, b.bytes, b.commit, kind, &b.stray, nullptr});
    };
    add(salvage.headers, Kind::kMapHeader);
    add(salvage.pages, Kind::kIndexPage);
    add(salvage.roots, Kind::kIndexRoot);
    add(salvage.footers, Kind::kFooter);
    for (FoundLayer& l : salvage.layers) {
      items_.push_back({l.info.locator, l.info.stored_bytes, l.commit, Kind::kLayer, &l.stray, &l});
    }
    for (Broken& b : salvage.broken) {
      if (b.kind != Kind{}) items_.push_back({b.offset, b.bytes, b.commit, b.kind, &b.stray, nullptr});
    }
    std::ranges::sort(items_, {}, &Placed::offset);
  }

  bool one_commit() const {
    return std::ranges::all_of(items_, [](const Placed& p) { return p.commit == 1; });
  }

  void mark_in_archive() {
    keep_between_footers();
    keep_longest_run(left([](const Placed&) { return true; }),
                     [](const Placed& a, const Placed& b) { return a.commit <= b.commit; });
  }

  void mark_in_sealed_file() {
    const auto end = end_of_map();
    for (const Placed& p : items_) *p.stray = p.commit != 1 || (end && p.offset >= *end);
    mark_other_maps();
    mark_what_adjoins();
    keep_longest_run(
        left([](const Placed& p) { return p.layer != nullptr; }), [](const Placed& a, const Placed& b) {
          return std::tuple(a.layer->key, a.layer->info.type) < std::tuple(b.layer->key, b.layer->info.type);
        });
  }

 private:
  template <class Wanted>
  std::vector<const Placed*> left(Wanted wanted) const {
    std::vector<const Placed*> out;
    for (const Placed& p : items_) {
      if (!*p.stray && wanted(p)) out.push_back(&p);
    }
    return out;
  }

  /// What a footer says that lies where it says; of a page of another file it lies elsewhere.
  std::optional<Footer> footer_in_place(const FoundBlock& block) const {
    const auto footer = salvage_.footer(block);
    return footer && footer->file_bytes == block.offset + kFooterBlockBytes ? footer : std::nullopt;
  }

  /// Between two commits that ended there are no others' numbers, and of a commit that ended only the header
  /// and the root that its footers name.
  void keep_between_footers() {
    std::vector<std::pair<std::uint64_t, std::uint64_t>> ends;  // offset of a footer and its number
    std::unordered_set<std::uint64_t> ended, named;             // commits; hashes
    for (const FoundBlock& block : salvage_.footers) {
      const auto footer = footer_in_place(block);
      if (!footer) continue;
      ends.emplace_back(block.offset, block.commit);
      ended.insert(block.commit);
      named.insert({footer->header_hash, footer->root_hash});
    }
    std::ranges::sort(ends);
    std::size_t before = 0;
    for (const Placed& p : items_) {
      while (before < ends.size() && ends[before].first < p.offset) ++before;
      *p.stray = (before > 0 && p.commit < ends[before - 1].second) ||
                 (before < ends.size() && p.commit > ends[before].second);
    }
    for (auto* list : {&salvage_.headers, &salvage_.roots}) {
      for (FoundBlock& block : *list) {
        block.stray |= ended.contains(block.commit) && !named.contains(block.payload_hash);
      }
    }
  }

  /// End of the first footer that lies where it says.
  std::optional<std::uint64_t> end_of_map() {
    for (const FoundBlock& block : salvage_.footers) {
      const auto footer = footer_in_place(block);
      if (block.commit != 1 || !footer) continue;
      header_hash_ = footer->header_hash;
      return footer->file_bytes;
    }
    return {};
  }

  /// Hash of the map's header: the footer's, else that of the header in its place, else of one a footer
  /// names, else of the first.
  std::optional<std::uint64_t> own_header() const {
    if (header_hash_) return header_hash_;
    const auto& headers = salvage_.headers;
    if (headers.empty()) return {};
    std::unordered_set<std::uint64_t> hashes;
    for (const FoundBlock& block : headers) {
      if (block.offset == kHeaderPlace) return block.payload_hash;
      hashes.insert(block.payload_hash);
    }
    for (const FoundBlock& block : salvage_.footers) {
      const auto footer = salvage_.footer(block);
      if (footer && hashes.contains(footer->header_hash)) return footer->header_hash;
    }
    return headers.front().payload_hash;
  }

  /// Other headers, footers of other headers, and roots that none of the own footers names.
  void mark_other_maps() {
    const auto own = own_header();
    if (!own) return;
    std::unordered_set<std::uint64_t> roots;
    bool found = false;  // maps may have headers that are alike: the first is the file's
    for (FoundBlock& block : salvage_.headers) {
      block.stray |= found || block.payload_hash != *own;
      found |= !block.stray;
    }
    for (FoundBlock& block : salvage_.footers) {
      const auto footer = salvage_.footer(block);
      block.stray |= !footer || footer->header_hash != *own;
      if (!block.stray) roots.insert(footer->root_hash);
    }
    if (roots.empty()) return;
    for (FoundBlock& block : salvage_.roots) block.stray |= !roots.contains(block.payload_hash);
  }

  /// What follows another map's header without a gap, or leads to its footer, is of that map.
  void mark_what_adjoins() {
    bool other = false;
    std::uint64_t at = 0;
    for (const Placed& p : items_) {
      if (p.kind == Kind::kMapHeader) {
        other = *p.stray;
      } else if (p.offset != at || (p.kind == Kind::kFooter && !*p.stray)) {
        other = false;
      }
      *p.stray |= other;
      at = p.offset + p.bytes;
    }
    other = false;
    for (auto p = items_.rbegin(); p != items_.rend(); ++p) {
      if (p->kind == Kind::kFooter) {
        other = *p->stray;
      } else if (p->offset + p->bytes != at || p->kind == Kind::kMapHeader) {
        other = false;
      }
      *p->stray |= other;
      at = p->offset;
    }
  }

  Salvage& salvage_;
  std::vector<Placed> items_;
  std::optional<std::uint64_t> header_hash_;  // as the footer has it that lies where it says
};

}  // namespace

void mark_strays(Salvage& salvage, const std::optional<bool>& archive) {
  Strays strays(salvage);
  salvage.sealed = archive ? !*archive : strays.one_commit();
  if (salvage.sealed) {
    strays.mark_in_sealed_file();
  } else {
    strays.mark_in_archive();
  }
}

}  // namespace apgm::format
