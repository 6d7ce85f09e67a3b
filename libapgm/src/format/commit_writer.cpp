#include "commit_writer.hpp"

#include <cstring>

#include "apgm/core/error.hpp"
#include "layer_block.hpp"
#include "map_header.hpp"

namespace apgm::format {
namespace {

/// A page that shrank below this is written together with the next, so that commits do not wear the index
/// down to crumbs.
constexpr std::size_t kSmallPage = 128;

}  // namespace

CommitWriter::CommitWriter(BlockOutput& output, std::uint64_t number, const MapHeader& header)
    : output_(output), types_(header.types), id_(header), totals_(header.types.size()) {
  footer_.commits = number;
  footer_.header_hash = append_map_header(block_, header, number).payload_hash;
  footer_.header_bytes = block_.size();
}

void CommitWriter::write_header() {
  footer_.header_offset = output_.size();
  write_block();
}

void CommitWriter::write_block() {
  output_.write(block_);
  block_.clear();
}

void CommitWriter::add(const Parcel& parcel) {
  const StoredLayer& stored = parcel.stored;
  const std::uint64_t offset = output_.size();
  const BlockHeader h = append_layer(block_, parcel, footer_.commits);
  const auto bytes = static_cast<std::uint32_t>(block_.size());
  write_block();
  touch();
  list({h.key, offset, stored.content_hash, h.payload_hash, parcel.stamp_ns, parcel.patch.x, parcel.patch.y,
        bytes, parcel.type, stored.step, stored.encoding, 0});
}

void CommitWriter::list(const IndexEntry& e) {
  const PatchIndex patch{e.ix, e.iy};
  if (last_patch_ != patch) ++footer_.patches;
  last_patch_ = patch;
  ++footer_.layers;
  range_.add(patch);
  id_.add(patch, e.type, e.step, e.content_hash);
  Summary::OfType& totals = totals_[e.type];
  ++totals.layers;
  ++totals.layers_at[e.step];
  totals.stored_bytes += e.stored_bytes;
  totals.raw_bytes += value_bytes(types_[e.type], e.step);
  page_.push_back(e);
  // A page that is rewritten may grow to twice the size before it is split.
  const std::size_t most = stored_page_ ? 2 * kPageEntriesWritten : kPageEntriesWritten;
  while (touched_ && page_.size() >= most) flush_page(kPageEntriesWritten);
}

void CommitWriter::flush_page(std::size_t entries) {
  if (entries == 0) return;
  pages_.push_back(append_page(block_, output_.size(), std::span(page_).first(entries), footer_.commits));
  write_block();
  page_.erase(page_.begin(), page_.begin() + static_cast<std::ptrdiff_t>(entries));
}

void CommitWriter::close_page(bool last) {
  if (stored_page_ && !touched_) {
    pages_.push_back(*stored_page_);
    page_.clear();
  } else if (last || page_.size() >= kSmallPage) {
    while (page_.size() >= 2 * kPageEntriesWritten) flush_page(kPageEntriesWritten);
    flush_page(page_.size());
  }
}

void CommitWriter::start_page(const fbs::PageRef& page) {
  close_page(false);
  stored_page_ = page;
  touched_ = !page_.empty();
}

bool CommitWriter::same_index(const Root& root) const {
  return totals_ == root.totals && pages_.size() == root.pages.size() &&
         (pages_.empty() ||
          std::memcmp(pages_.data(), root.pages.data(), pages_.size() * sizeof(fbs::PageRef)) == 0);
}

Footer CommitWriter::finish(const Footer* shared_footer, const Root* shared_root) {
  close_page(true);
  if (pages_.size() > kMaxPages) throw Error(ErrorCode::kLimit, "a file holds at most 2^20 index pages");
  if (shared_root != nullptr && same_index(*shared_root)) {
    footer_.root_offset = shared_footer->root_offset;
    footer_.root_bytes = shared_footer->root_bytes;
    footer_.root_hash = shared_footer->root_hash;
  } else {
    footer_.root_offset = output_.size();
    append_root(block_, pages_, totals_, footer_.commits);
    footer_.root_bytes = block_.size();
    footer_.root_hash = read_as<BlockHeader>(block_).payload_hash;
    write_block();
  }
  footer_.content_id = id_.value();
  footer_.x_min = range_.min.x;
  footer_.y_min = range_.min.y;
  footer_.x_max = range_.max.x;
  footer_.y_max = range_.max.y;
  footer_.file_bytes = output_.size() + kFooterBlockBytes;
  return footer_;
}

std::vector<std::byte> footer_block(const Footer& footer) {
  std::vector<std::byte> block;
  append_block(block, Kind::kFooter, 0, {}, bytes_of(footer), footer.commits);
  return block;
}

}  // namespace apgm::format
