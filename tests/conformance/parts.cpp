#include "parts.hpp"

#include <algorithm>
#include <cstring>

#include <xxhash.h>
#include <zstd.h>

#include "bodies.hpp"
#include "content_id.hpp"

namespace apgm::test {
namespace {

std::uint64_t hash_of(const void* data, std::size_t bytes) { return XXH3_64bits(data, bytes); }

template <typename T>
std::string text_of(const T& value) {
  return {reinterpret_cast<const char*>(&value), sizeof(T)};
}

std::string text_of(const flatbuffers::FlatBufferBuilder& fb) {
  std::string text(reinterpret_cast<const char*>(fb.GetBufferPointer()), fb.GetSize());
  text.resize((text.size() + 7) / 8 * 8);
  return text;
}

std::string join(const std::vector<std::string>& names) {
  std::string text;
  for (const auto& name : names) text += (text.empty() ? "" : " ") + name;
  return text;
}

std::string layer_flat(const StoredPart& layer) {
  flatbuffers::FlatBufferBuilder fb;
  const Entry& e = layer.entry;
  fb.Finish(fbs::CreateLayer(fb, e.ix, e.iy, e.type, e.step, e.encoding, e.stamp_ns, e.content_hash,
                             layer.error_bound));
  return text_of(fb);
}

std::string page_payload(const std::vector<Entry>& entries, std::uint32_t& m) {
  flatbuffers::FlatBufferBuilder fb;
  fb.Finish(fbs::CreateIndexPage(fb, static_cast<std::uint32_t>(entries.size())));
  const std::string flat = text_of(fb);
  m = static_cast<std::uint32_t>(flat.size());
  std::string columns(entries.size() * sizeof(Entry), '\0');
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const std::string row = text_of(entries[i]);
    for (std::size_t k = 0; k < row.size(); ++k) columns[k * entries.size() + i] = row[k];
  }
  return flat + zstd_frame(columns);
}

std::string root_payload(const std::vector<fbs::PageRef>& pages, const std::vector<fbs::TypeTotals>& totals) {
  flatbuffers::FlatBufferBuilder fb;
  const auto pages_at = fb.CreateVectorOfStructs(pages);
  const auto totals_at = fb.CreateVectorOfStructs(totals);
  fb.Finish(fbs::CreateIndexRoot(fb, pages_at, totals_at));
  return text_of(fb);
}

/// Lays block after block and remembers what index and footer say of them.
class Builder {
 public:
  Builder(const Parts& parts, const Hooks& hooks, ArchiveParts* archive = nullptr)
      : parts_(parts), hooks_(hooks), archive_(archive) {}

  std::string run() {
    begin();
    map_header();
    for (const StoredPart& part : parts_.layers) layer(part);
    if (!page_.empty()) page();
    root();
    footer();
    end();
    return out_;
  }

  /// The index is that of the last commit.
  void run_header_only() {
    begin();
    footer_ = archive_->footer;
    footer_.previous = archive_->last_footer;
    commit_ = footer_.commits;
    map_header();
    entries_ = archive_->entries;
    footer_.file_bytes = out_.size() + sizeof(BlockHead) + sizeof(Footer);
    if (hooks_.footer) hooks_.footer(footer_);
    add_footer();
    end();
  }

 private:
  struct Placed {
    std::uint64_t offset, bytes, hash;
  };

  void begin() {
    if (archive_ != nullptr) {
      footer_.commits = commit_ = archive_->next_number;
      footer_.previous = archive_->last_footer;
      out_ = archive_->bytes;
    }
    if (out_.empty()) preamble();
  }

  void end() {
    if (archive_ == nullptr) return;
    archive_->next_number = footer_.commits + 1;
    archive_->last_footer = out_.size() - sizeof(BlockHead) - sizeof(Footer);
    archive_->bytes = out_;
    archive_->footer = footer_;
    archive_->entries = entries_;
  }

  Placed add(BlockHead head, std::string payload) {
    if (head.kind != kFooter) come_before(head.kind);
    head.commit = commit_;
    if (hooks_.payload) hooks_.payload(head, payload);
    head.p = payload.size();
    head.payload_hash = hash_of(payload.data(), payload.size());
    const Placed placed{out_.size(), sizeof(BlockHead) + (payload.size() + 7) / 8 * 8, head.payload_hash};
    if (hooks_.head) hooks_.head(head);
    head.hash = hash_of(&head, offsetof(BlockHead, hash));
    std::string block = text_of(head) + payload;
    block.resize(placed.bytes);
    if (hooks_.block) hooks_.block(head, block);
    out_ += block;
    return placed;
  }

  void come_before(std::uint8_t kind) {
    if (hooks_.before) out_ += hooks_.before(kind);
  }

  void preamble() {
    Preamble p{};
    std::memcpy(p.magic.data(),
                "\x89"
                "APGM\r\n\x1a",
                p.magic.size());
    p.major = 1;
    if (archive_ != nullptr) p.minor = 1, p.compat = 1;
    if (hooks_.preamble) hooks_.preamble(p);
    p.hash = hash_of(&p, offsetof(Preamble, hash));
    out_ = text_of(p);
  }

  void map_header() {
    const std::string flat =
        parts_.map_header.empty() ? map_header_flat(raw(parts_.header)) : parts_.map_header;
    BlockHead head;
    head.kind = kMapHeader;
    head.m = static_cast<std::uint32_t>(flat.size());
    const Placed placed = add(head, flat);
    footer_.header_offset = placed.offset;
    footer_.header_bytes = placed.bytes;
    footer_.header_hash = placed.hash;
    totals_.resize(parts_.header.types.size());
  }

  void layer(const StoredPart& part) {
    if (part.entry.offset != 0) return list(part.entry);
    const std::string flat = layer_flat(part);
    BlockHead head;
    head.kind = kLayer;
    head.m = static_cast<std::uint32_t>(flat.size());
    Entry e = part.entry;
    head.key = e.key = curve_key({e.ix, e.iy});
    const Placed placed = add(head, flat + part.body);
    e.offset = placed.offset;
    e.bytes = static_cast<std::uint32_t>(placed.bytes);
    e.payload_hash = placed.hash;
    list(e);
  }

  void list(const Entry& e) {
    page_.push_back(e);
    if (page_.size() == parts_.page_entries) page();
  }

  /// Totals, counts and content id say what the index says, right or wrong: a fault stands alone.
  void count(const Entry& e) {
    if (footer_.layers == 0 || e.key != last_key_) ++footer_.patches;
    last_key_ = e.key;
    ++footer_.layers;
    if (e.type >= totals_.size() || e.step > kMaxStep) return;
    id_.add({e.ix, e.iy}, e.type, e.step, e.content_hash);
    Total& t = totals_[e.type];
    ++t.layers;
    ++t.layers_at[e.step];
    t.stored += e.bytes;
    t.raw += (std::uint64_t{4} << (2 * e.step)) * parts_.header.types[e.type].channels.size();
  }

  void page() {
    if (hooks_.page) hooks_.page(page_);
    PatchRange range;
    entries_.insert(entries_.end(), page_.begin(), page_.end());
    for (const Entry& e : page_) {
      count(e);
      range.add(PatchIndex{e.ix, e.iy});
    }
    range_.add(range);
    BlockHead head;
    head.kind = kIndexPage;
    head.key = page_.front().key;
    const std::string payload = page_payload(page_, head.m);
    const Placed placed = add(head, payload);
    pages_.emplace_back(placed.offset, placed.bytes, placed.hash, page_.front().key, page_.back().key,
                        range.min.x, range.min.y, range.max.x, range.max.y,
                        static_cast<std::uint32_t>(page_.size()), 0);
    page_.clear();
  }

  void root() {
    std::vector<fbs::TypeTotals> totals;
    for (const Total& t : totals_) {
      totals.emplace_back(t.layers, t.stored, t.raw, flatbuffers::span<const std::uint64_t, 12>(t.layers_at));
    }
    if (hooks_.root) hooks_.root(pages_, totals);
    const std::string payload = root_payload(pages_, totals);
    BlockHead head;
    head.kind = kIndexRoot;
    head.m = static_cast<std::uint32_t>(payload.size());
    const Placed placed = add(head, payload);
    footer_.root_offset = placed.offset;
    footer_.root_bytes = placed.bytes;
    footer_.root_hash = placed.hash;
  }

  void footer() {
    come_before(kFooter);  // it counts in the size of the file
    footer_.x_min = range_.min.x;
    footer_.y_min = range_.min.y;
    footer_.x_max = range_.max.x;
    footer_.y_max = range_.max.y;
    footer_.content_id = id_.value();
    footer_.file_bytes = out_.size() + sizeof(BlockHead) + sizeof(Footer);
    if (hooks_.footer) hooks_.footer(footer_);
    add_footer();
  }

  void add_footer() {
    BlockHead head;
    head.kind = kFooter;
    add(head, text_of(footer_));
  }

  struct Total {
    std::uint64_t layers = 0, stored = 0, raw = 0;
    std::array<std::uint64_t, 12> layers_at{};
  };

  const Parts& parts_;
  const Hooks& hooks_;
  ArchiveParts* archive_;
  std::uint64_t commit_ = 1;
  std::string out_;
  format::ContentId id_{parts_.header};
  std::vector<Total> totals_;
  std::vector<Entry> page_;
  std::vector<Entry> entries_;
  std::vector<fbs::PageRef> pages_;
  PatchRange range_;
  std::uint64_t last_key_ = 0;
  Footer footer_;
};

}  // namespace

std::string put_together(const Parts& parts, const Hooks& hooks) { return Builder(parts, hooks).run(); }

void append_commit(ArchiveParts& archive, const Parts& parts, const Hooks& hooks) {
  Builder(parts, hooks, &archive).run();
}

void replace_header(ArchiveParts& archive, const MapHeader& header, const Hooks& hooks) {
  Parts parts;
  parts.header = header;
  Builder(parts, hooks, &archive).run_header_only();
}

std::string make_block(BlockHead head, const std::string& payload) {
  head.p = payload.size();
  head.payload_hash = hash_of(payload.data(), payload.size());
  head.hash = hash_of(&head, offsetof(BlockHead, hash));
  std::string block = text_of(head) + payload;
  block.resize((block.size() + 7) / 8 * 8);
  return block;
}

std::string map_header_flat(const RawHeader& h) {
  flatbuffers::FlatBufferBuilder fb;
  std::vector<flatbuffers::Offset<fbs::LayerType>> types;
  for (const RawType& t : h.types) {
    types.push_back(
        fbs::CreateLayerTypeDirect(fb, t.name.c_str(), t.hypotheses.empty() ? nullptr : t.hypotheses.c_str(),
                                   t.channels.c_str(), t.policy.c_str(), t.has_slab, t.z_min_um, t.z_max_um));
  }
  std::vector<flatbuffers::Offset<fbs::KeyValue>> metadata;
  for (const auto& [key, value] : h.metadata) {
    const auto key_at = fb.CreateString(key);
    const auto value_at = h.shares_values ? fb.CreateSharedString(value) : fb.CreateString(value);
    metadata.push_back(fbs::CreateKeyValue(fb, key_at, value_at));
  }
  std::vector<flatbuffers::Offset<fbs::Provenance>> history;
  for (const auto& [operation, inputs, parameters] : h.history) {
    history.push_back(fbs::CreateProvenanceDirect(fb, operation.c_str(), inputs.c_str(), parameters.c_str()));
  }
  const auto frame_id = fb.CreateString(h.frame_id);
  const auto types_at = fb.CreateVector(types);
  const auto metadata_at = fb.CreateVector(metadata);
  const auto history_at = fb.CreateVector(history);
  fb.Finish(fbs::CreateMapHeader(fb, h.edge_um, h.datum_x_um, h.datum_y_um, h.epsg, frame_id, types_at,
                                 metadata_at, history_at, h.stamp_ns));
  return text_of(fb);
}

RawHeader raw(const MapHeader& header) {
  const Frame& f = header.frame;
  RawHeader h{f.edge_um, f.datum_x_um, f.datum_y_um, f.epsg.value_or(0), f.frame_id,
              {},        {},           {},           header.stamp_ns};
  for (const LayerType& t : header.types) {
    const Slab slab = t.slab.value_or(Slab{});
    h.types.push_back({t.name, join(t.hypotheses), join(t.channels), std::string(to_string(t.policy)),
                       t.slab.has_value(), slab.z_min_um, slab.z_max_um});
  }
  h.metadata.assign(header.metadata.begin(), header.metadata.end());
  for (const Provenance& p : header.history) h.history.push_back({p.operation, join(p.inputs), p.parameters});
  return h;
}

}  // namespace apgm::test
