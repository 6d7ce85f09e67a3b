#include "file_cursor.hpp"

#include <utility>

#include "apgm/core/error.hpp"
#include "located.hpp"

namespace apgm::format {
namespace {

std::pair<std::uint64_t, std::uint16_t> order(const IndexEntry& e) { return {e.key, e.type}; }

}  // namespace

bool FileCursor::next(PatchInfo& out) {
  out.layers.clear();
  for (;;) {
    if (at_ == entries_.size() && !next_page()) return !out.layers.empty();
    const IndexEntry& e = entries_[at_];
    const PatchIndex patch{e.ix, e.iy};
    if (!out.layers.empty() && patch != out.patch) return true;
    ++at_;
    if (range_ && !range_->contains(patch)) continue;
    out.patch = patch;
    out.layers.push_back(
        {patch, e.type, e.step, e.encoding, e.stored_bytes, e.content_hash, e.stamp_ns, e.offset});
  }
}

bool FileCursor::next_page() {
  while (page_ < root_.pages.size()) {
    const fbs::PageRef& ref = root_.pages[page_++];
    const PatchRange covers{{ref.x_min(), ref.y_min()}, {ref.x_max(), ref.y_max()}};
    if (range_ && !range_->meets(covers)) continue;
    buffer_.resize(ref.bytes());
    file_.read(ref.offset(), buffer_);
    located(file_, ref.offset(), "", [&] { take_page(ref); });
    at_ = 0;
    return true;
  }
  return false;
}

void FileCursor::take_page(const fbs::PageRef& ref) {
  const bool first = entries_.empty();
  const auto last = first ? std::pair<std::uint64_t, std::uint16_t>{} : order(entries_.back());
  read_page(buffer_, ref, end_, types_, root_, entries_);
  if (!first && order(entries_.front()) <= last)
    throw Error(ErrorCode::kDamaged, "index entries are not in order");
}

std::vector<std::byte>& layer_buffer() {
  thread_local std::vector<std::byte> buffer;
  return buffer;
}

LoadedLayer read_layer(const InputFile& file, const LayerInfo& info, std::vector<std::byte>& buffer) {
  buffer.resize(info.stored_bytes);
  file.read(info.locator, buffer);
  const Block block = parse_block(buffer, Kind::kLayer);
  const LayerBlock layer = read_layer_block(block);
  const LayerInfo& l = layer.info;
  if (l.patch != info.patch || l.type != info.type || l.step != info.step || l.encoding != info.encoding ||
      l.content_hash != info.content_hash || l.stamp_ns != info.stamp_ns) {
    throw Error(ErrorCode::kDamaged, "the block is not the one the index names");
  }
  return {layer, block.body};
}

void read_stored(const InputFile& file, const LayerInfo& info, StoredLayer& out) {
  const LoadedLayer loaded = read_layer(file, info, layer_buffer());
  out.encoding = info.encoding;
  out.step = info.step;
  out.content_hash = info.content_hash;
  out.error_bound = loaded.layer.error_bound;
  out.bytes.assign(loaded.body.begin(), loaded.body.end());
}

}  // namespace apgm::format
