#include <algorithm>
#include <iterator>
#include <set>

#include "content_id.hpp"
#include "map_header.hpp"
#include "recover_plan.hpp"

namespace apgm::format {
/// The newest commit that any block is of, and its footer.
void RecoverPlan::find_newest() {
  const auto see = [&](const auto& found) {
    if (!found.stray) newest_ = std::max(newest_, found.commit);
  };
  for (const auto* list : {&salvage_.headers, &salvage_.pages, &salvage_.roots, &salvage_.footers}) {
    for (const FoundBlock& block : *list) see(block);
  }
  for (const FoundLayer& layer : salvage_.layers) see(layer);
  for (const Broken& broken : salvage_.broken) see(broken);
  for (auto at = salvage_.footers.rbegin(); at != salvage_.footers.rend() && !footer_; ++at) {
    if (at->commit == newest_ && !at->stray) footer_ = salvage_.footer(*at);
    footer_in_place_ = footer_ && footer_->file_bytes == at->offset + kFooterBlockBytes;
  }
  report_.commit = newest_;
  std::set<std::uint64_t> older;  // one commit may have several footers
  for (const FoundBlock& footer : salvage_.footers) {
    if (footer.commit < newest_ && !footer.stray) older.insert(footer.commit);
  }
  report_.older_commits = older.size();
}

std::string RecoverPlan::stated_id() const { return footer_ ? to_hex(footer_->content_id) : std::string(); }

/// The header that the newest footer names; and of the headers of each commit the last.
void RecoverPlan::find_headers() {
  std::vector<FoundBlock>& headers = salvage_.headers;
  const auto named = [&] {
    return std::ranges::find(headers, footer_->header_hash, &FoundBlock::payload_hash);
  };
  if (footer_) {
    if (named() == headers.end()) {
      salvage_.find_header(footer_->header_offset, footer_->header_bytes, footer_->header_hash,
                           footer_->commits);
    }
    if (const auto at = named(); at != headers.end()) named_header_ = *at;
  }
  for (const FoundBlock& block : headers) {
    if (!block.stray) header_of_[block.commit] = block;
  }
}

const FoundBlock* RecoverPlan::header_of(std::uint64_t commit) const {
  const auto at = header_of_.find(commit);
  return at == header_of_.end() ? nullptr : &at->second;
}

const FoundBlock* RecoverPlan::newest_header(std::uint64_t up_to) const {
  const auto after = header_of_.upper_bound(up_to);
  return after == header_of_.begin() ? nullptr : &std::prev(after)->second;
}

MapHeader RecoverPlan::read_header(const FoundBlock& block) const {
  return read_map_header(salvage_.block(block.offset, block.bytes));
}

/// Many roots may ask for one header: that of the footer, or that of their commit, by which they are sorted.
const MapHeader* RecoverPlan::remembered_header(const FoundBlock& block) {
  const bool named = named_header_ && named_header_->offset == block.offset;
  Remembered& slot = remembered_[named ? 0 : 1];
  if (slot.offset == block.offset) return slot.header ? &*slot.header : nullptr;
  slot = {block.offset, std::nullopt};
  try {
    slot.header = read_header(block);
  } catch (const Error& e) {
    if (e.code() == ErrorCode::kUnreadable) throw;
    return nullptr;
  }
  return &*slot.header;
}

/// The newest index whose root is there, with a header that fits it.
bool RecoverPlan::find_root() {
  std::vector<FoundBlock> roots = salvage_.roots;
  std::ranges::stable_sort(roots, [](const FoundBlock& a, const FoundBlock& b) {
    return std::pair(a.commit, a.offset) > std::pair(b.commit, b.offset);
  });
  for (const FoundBlock& root : roots) {
    check_cancelled();
    const FoundBlock* block = nullptr;
    const bool named = footer_ && footer_->root_hash == root.payload_hash;
    if (root.stray && !named) continue;
    if (named && named_header_) block = &*named_header_;
    if (block == nullptr) block = header_of(root.commit);
    if (block == nullptr && options_.header == nullptr) block = newest_header(root.commit);
    if (use_root(root, block, options_.header)) return true;
  }
  return false;
}

bool RecoverPlan::use_root(const FoundBlock& found, const FoundBlock* header_block, const MapHeader* given) {
  if (header_block == nullptr && given == nullptr) return false;
  const MapHeader* map_header = header_block != nullptr ? remembered_header(*header_block) : given;
  if (map_header == nullptr) return false;
  try {
    constexpr std::uint64_t kAnywhere = std::uint64_t{1} << 62;  // places are found by hash
    const Root root =
        read_root(salvage_.block(found.offset, found.bytes), kAnywhere, map_header->types.size());
    const bool named = footer_ && footer_->root_hash == found.payload_hash;
    if (!named && is_of_another_file(root)) return false;
    root_ = root;
    root_commit_ = found.commit;
    header = *map_header;
    took_header(header_block);
    return true;
  } catch (const Error& e) {
    if (e.code() == ErrorCode::kUnreadable) throw;
    return false;
  }
}

/// None of its pages is there, and where one should be there is a whole layer.
bool RecoverPlan::is_of_another_file(const Root& root) {
  if (page_hashes_.empty()) {
    for (const FoundBlock& page : salvage_.pages) page_hashes_.insert(page.payload_hash);
  }
  const auto place = [](const FoundLayer& layer) { return layer.info.locator; };
  bool contradicts = false;
  for (const fbs::PageRef& page : root.pages) {
    if (page_hashes_.contains(page.hash())) return false;
    // Layers are by place, so far.
    const auto after = std::ranges::upper_bound(salvage_.layers, page.offset(), {}, place);
    if (after == salvage_.layers.begin()) continue;
    const FoundLayer& before = *std::prev(after);
    contradicts |= page.offset() - place(before) < before.info.stored_bytes;
  }
  return contradicts;
}

void RecoverPlan::use_header_alone() {
  const FoundBlock* block = named_header_ ? &*named_header_ : nullptr;
  if (block == nullptr) block = header_of(newest_);
  if (block == nullptr && options_.header == nullptr) block = newest_header(newest_);
  if (block == nullptr && options_.header == nullptr) {
    HeaderLost error(ErrorCode::kDamaged, "'" + file_.path() + "' is damaged: no map header is left in it");
    error.hint("another map with the same frame and layer types can stand in for it").at(file_.path());
    throw error;
  }
  header = block != nullptr ? read_header(*block) : *options_.header;
  took_header(block);
}

/// Says so if the header is not the one the newest commit had.
void RecoverPlan::took_header(const FoundBlock* block) {
  header_is_given_ = block == nullptr;
  if (header_is_given_) {
    header.metadata.clear();
    header.history.clear();
    header.stamp_ns = 0;
    lose(sizeof(Preamble), "the map header: frame and layer types are those that were given");
  } else if (footer_ ? footer_->header_hash != block->payload_hash : block->commit != newest_) {
    lose(block->offset, "the map header of commit " + std::to_string(newest_) + ": that of commit " +
                            std::to_string(block->commit) + " stands in for it");
  }
}

}  // namespace apgm::format
