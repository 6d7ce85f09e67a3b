#include "loose_file.hpp"

#include <algorithm>

#include "apgm/core/error.hpp"
#include "codec.hpp"
#include "content_id.hpp"
#include "index.hpp"
#include "map_header.hpp"

namespace apgm::fuzz {

using namespace format;

namespace {

constexpr std::size_t kMostEntries = 4 * kPageEntries;

Bytes meta_of(const LooseFile::Block& block) {
  return Bytes(block.payload).first(std::min<std::size_t>(block.header.meta_bytes, block.payload.size()));
}

/// The table at the start of a payload; nullptr if it is none.
template <typename T>
const T* table_of(const LooseFile::Block& block) {
  const Bytes meta = meta_of(block);
  if (meta.empty()) return nullptr;
  flatbuffers::Verifier verifier(reinterpret_cast<const std::uint8_t*>(meta.data()), meta.size(), 8, 64);
  return verifier.VerifyBuffer<T>(nullptr) ? flatbuffers::GetRoot<T>(meta.data()) : nullptr;
}

std::uint64_t size_of(const LooseFile::Block& block) {
  return sizeof(BlockHeader) + padded(block.payload.size());
}

void unpack_page(LooseFile::Block& page) {
  const auto* table = table_of<fbs::IndexPage>(page);
  if (table == nullptr || table->entries() < 1 || table->entries() > kMostEntries) return;
  const std::size_t n = table->entries();
  std::vector<std::byte> columns(n * sizeof(IndexEntry));
  try {
    read_frame(Bytes(page.payload).subspan(meta_of(page).size()), columns);
  } catch (const Error&) {
    return;
  }
  page.entries.resize(n);
  auto* out = reinterpret_cast<std::byte*>(page.entries.data());
  for (std::size_t i = 0; i < columns.size(); ++i) out[i % n * sizeof(IndexEntry) + i / n] = columns[i];
}

void pack_page(LooseFile::Block& page) {
  std::vector<std::byte> block;
  append_page(block, 0, page.entries);
  const auto header = read_as<BlockHeader>(block);
  page.header.meta_bytes = header.meta_bytes;
  const auto payload = Bytes(block).subspan(sizeof(BlockHeader), header.payload_bytes);
  page.payload.assign(payload.begin(), payload.end());
}

/// What a root says of a page: `ref` where the page could not be unpacked.
fbs::PageRef said_of(const LooseFile::Block& page, const fbs::PageRef& ref) {
  if (page.entries.empty()) return ref;
  std::vector<std::byte> ignored;
  return append_page(ignored, 0, page.entries);
}

}  // namespace

std::optional<LooseFile> LooseFile::parse(Bytes file) {
  if (file.size() < sizeof(Preamble)) return {};
  LooseFile loose;
  loose.preamble_ = read_as<Preamble>(file);
  for (std::uint64_t at = sizeof(Preamble); at + sizeof(BlockHeader) <= file.size();) {
    Block block;
    block.header = read_as<BlockHeader>(file.subspan(at));
    block.old_offset = at;
    const Bytes rest = file.subspan(at + sizeof(BlockHeader));
    if (block.header.sync != kSync || block.header.payload_bytes > rest.size()) break;
    const Bytes payload = rest.first(block.header.payload_bytes);
    block.payload.assign(payload.begin(), payload.end());
    at += size_of(block);
    if (block.header.kind == Kind::kIndexPage) unpack_page(block);
    loose.blocks_.push_back(std::move(block));
  }
  if (loose.blocks_.empty()) return {};
  return loose;
}

void LooseFile::rehash_cells(Block& layer) const {
  const auto* table = table_of<fbs::Layer>(layer);
  const auto header =
      std::ranges::find(blocks_, Kind::kMapHeader, [](const Block& b) { return b.header.kind; });
  if (table == nullptr || header == blocks_.end() || table->step() > 8) return;
  try {
    std::vector<std::byte> block;
    append_block(block, Kind::kMapHeader, 0, header->payload, {});
    const MapHeader map = read_map_header(block);
    if (table->type() >= map.types.size()) return;
    Layer cells;
    decode(static_cast<Encoding>(table->encoding()), table->step(),
           Bytes(layer.payload).subspan(meta_of(layer).size()), map.types[table->type()], cells);
    flatbuffers::GetMutableRoot<flatbuffers::Table>(layer.payload.data())
        ->SetField<std::uint64_t>(fbs::Layer::VT_CONTENT_HASH, content_hash(cells), 0);
  } catch (const Error&) {
    return;
  }
}

const LooseFile::Place* LooseFile::place_of(std::uint64_t old_offset) const {
  const auto it = places_.find(old_offset);
  return it == places_.end() ? nullptr : &it->second;
}

void LooseFile::lay_out() {
  places_.clear();
  std::uint64_t at = sizeof(Preamble);
  for (const Block& block : blocks_) {
    places_.try_emplace(block.old_offset, Place{at, size_of(block), &block});
    at += size_of(block);
  }
}

void LooseFile::link_page(Block& page) {
  for (IndexEntry& entry : page.entries) {
    const Place* place = place_of(entry.offset);
    if (place == nullptr) continue;
    entry.stored_bytes = static_cast<std::uint32_t>(place->bytes);
    entry.stored_hash = hash_of(place->block->payload);
    if (const auto* layer = table_of<fbs::Layer>(*place->block)) entry.content_hash = layer->content_hash();
  }
}

void LooseFile::link_root(Block& root) const {
  const auto* table = table_of<fbs::IndexRoot>(root);
  if (table == nullptr || table->pages() == nullptr) return;
  const std::size_t first = static_cast<std::size_t>(
      table->pages()->Data() - reinterpret_cast<const std::uint8_t*>(root.payload.data()));
  for (std::size_t i = 0; i < table->pages()->size(); ++i) {
    std::byte* at = root.payload.data() + first + i * sizeof(fbs::PageRef);
    const auto ref = read_as<fbs::PageRef>(Bytes(at, sizeof(fbs::PageRef)));
    const Place* place = place_of(ref.offset());
    if (place == nullptr) continue;
    const fbs::PageRef linked = said_of(*place->block, ref);
    const fbs::PageRef placed(place->offset, place->bytes, hash_of(place->block->payload), linked.first_key(),
                              linked.last_key(), linked.x_min(), linked.y_min(), linked.x_max(),
                              linked.y_max(), linked.entries(), linked.reserved());
    std::memcpy(at, &placed, sizeof(placed));
  }
}

void LooseFile::link_footer(Block& block) const {
  if (block.payload.size() != sizeof(Footer)) return;
  auto footer = read_as<Footer>(block.payload);
  const auto fit = [&](std::uint64_t& offset, std::uint64_t& bytes, std::uint64_t& hash) {
    const Place* place = place_of(offset);
    if (place == nullptr) return;
    offset = place->offset;
    bytes = place->bytes;
    hash = hash_of(place->block->payload);
  };
  fit(footer.header_offset, footer.header_bytes, footer.header_hash);
  fit(footer.root_offset, footer.root_bytes, footer.root_hash);
  if (const Place* previous = place_of(footer.previous_footer)) footer.previous_footer = previous->offset;
  if (const Place* own = place_of(block.old_offset)) footer.file_bytes = own->offset + own->bytes;
  std::memcpy(block.payload.data(), &footer, sizeof(footer));
}

std::vector<std::byte> LooseFile::link(const Block* lies) {
  const auto each = [&](Kind kind, auto action) {
    for (Block& block : blocks_) {
      if (block.header.kind == kind) action(block);
    }
  };
  // Pages name offsets and are compressed, so offsets depend on offsets: a second pass mostly settles them.
  // Entries keep old offsets until the last.
  for (int pass = 0; pass < 2; ++pass) {
    lay_out();
    each(Kind::kIndexPage, [&](Block& page) {
      if (page.entries.empty()) return;
      const auto entries = page.entries;
      if (&page != lies) {
        link_page(page);
        for (IndexEntry& entry : page.entries) {
          if (const Place* place = place_of(entry.offset)) entry.offset = place->offset;
        }
      }
      pack_page(page);
      page.entries = entries;
    });
  }
  lay_out();
  each(Kind::kIndexRoot, [&](Block& root) {
    if (&root != lies) link_root(root);
  });
  each(Kind::kFooter, [&](Block& footer) {
    if (&footer != lies) link_footer(footer);
  });
  std::vector<std::byte> out(sizeof(Preamble));
  preamble_.hash = hash_of(format::bytes_of(preamble_).first(offsetof(Preamble, hash)));
  std::memcpy(out.data(), &preamble_, sizeof(preamble_));
  for (Block& block : blocks_) {
    BlockHeader& header = block.header;
    header.payload_bytes = block.payload.size();
    header.payload_hash = hash_of(block.payload);
    header.hash = hash_of(format::bytes_of(header).first(offsetof(BlockHeader, hash)));
    const Bytes head = format::bytes_of(header);
    out.insert(out.end(), head.begin(), head.end());
    out.insert(out.end(), block.payload.begin(), block.payload.end());
    out.resize(padded(out.size()));
  }
  return out;
}

}  // namespace apgm::fuzz
