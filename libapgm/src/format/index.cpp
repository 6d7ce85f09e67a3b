#include "index.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>

#include "apgm/core/error.hpp"
#include "codec.hpp"
#include "layer_block.hpp"

namespace apgm::format {
namespace {

// Pages hold small numbers in wide fields: a fixed level of zstd over transposed bytes takes most of it, and
// keeps the index equal whatever level the layers are stored at.
constexpr int kPageLevel = 3;

[[noreturn]] void fail(const char* what) { throw Error(ErrorCode::kDamaged, what); }

/// Transposes 8 x 8 bytes, a row in each word.
void transpose_block(std::array<std::uint64_t, 8>& rows) {
  const auto swap = [&](std::size_t distance, int shift, std::uint64_t mask) {
    for (std::size_t r = 0; r < 8; ++r) {
      if ((r & distance) != 0) continue;
      const std::uint64_t t = (rows[r] >> shift ^ rows[r + distance]) & mask;
      rows[r] ^= t << shift;
      rows[r + distance] ^= t;
    }
  };
  swap(4, 32, 0x00000000ffffffff);
  swap(2, 16, 0x0000ffff0000ffff);
  swap(1, 8, 0x00ff00ff00ff00ff);
}

/// Up to 8 bytes; as one word where they are 8.
void copy_word(void* to, const void* from, std::size_t n) {
  if (n == 8) {
    std::memcpy(to, from, 8);
  } else {
    std::memcpy(to, from, n);
  }
}

/// out[k * out_stride + i] = in[i * in_stride + k] for i below `rows` and k below `columns`. In blocks of 8 x
/// 8: byte by byte, columns a power of two apart would push each other out of the cache.
void transpose(const std::byte* in, std::size_t in_stride, std::size_t rows, std::size_t columns,
               std::byte* out, std::size_t out_stride) {
  for (std::size_t i = 0; i < rows; i += 8) {
    const std::size_t height = std::min<std::size_t>(8, rows - i);
    for (std::size_t k = 0; k < columns; k += 8) {
      const std::size_t width = std::min<std::size_t>(8, columns - k);
      std::array<std::uint64_t, 8> block{};
      for (std::size_t r = 0; r < height; ++r) copy_word(&block[r], in + (i + r) * in_stride + k, width);
      transpose_block(block);
      for (std::size_t c = 0; c < width; ++c) copy_word(out + (k + c) * out_stride + i, &block[c], height);
    }
  }
}

PatchRange range_of(std::span<const IndexEntry> entries) {
  PatchRange range;
  for (const IndexEntry& e : entries) range.add(PatchIndex{e.ix, e.iy});
  return range;
}

void check_entry(const IndexEntry& e, std::uint64_t end, const TypeTable& types, const Root& root) {
  if (e.key != curve_key({e.ix, e.iy})) fail("an index entry's key does not fit its patch");
  if (e.offset < sizeof(Preamble) || e.offset % 8 != 0 || e.offset > end || e.stored_bytes > end - e.offset ||
      e.stored_bytes < sizeof(BlockHeader) || e.stored_bytes % 8 != 0) {
    fail("an index entry points outside the file");
  }
  if (e.step > kMaxStep || e.type >= types.size() || root.totals[e.type].layers_at[e.step] == 0) {
    fail("an index entry names a step or type that does not exist");
  }
  if (value_bytes(types[e.type], e.step) > Layer::kMaxBytes)
    fail("an index entry names a layer of more than 64 MiB");
  if (e.stored_bytes > most_stored_bytes(types[e.type], e.step))
    fail("an index entry names a block that is too large");
  if (e.reserved != 0) fail("an index entry holds reserved values");
  if (e.encoding > kLastEncoding) {
    throw Error(ErrorCode::kUnsupported, "a layer is stored in encoding " + std::to_string(e.encoding))
        .hint("a newer version of apgm can read it");
  }
}

}  // namespace

fbs::PageRef append_page(std::vector<std::byte>& out, std::uint64_t offset,
                         std::span<const IndexEntry> entries, std::uint64_t commit) {
  const auto n = static_cast<std::uint32_t>(entries.size());
  flatbuffers::FlatBufferBuilder fb(64);
  fb.Finish(fbs::CreateIndexPage(fb, n));
  std::vector<std::byte> columns(n * sizeof(IndexEntry));
  // Byte k of every entry side by side.
  transpose(reinterpret_cast<const std::byte*>(entries.data()), sizeof(IndexEntry), n, sizeof(IndexEntry),
            columns.data(), n);
  std::vector<std::byte> body;
  append_frame(body, columns, kPageLevel);
  const std::size_t start = out.size();
  const BlockHeader header =
      append_block(out, Kind::kIndexPage, entries.front().key,
                   std::as_bytes(std::span(fb.GetBufferPointer(), fb.GetSize())), body, commit);
  const PatchRange range = range_of(entries);
  return {offset,
          out.size() - start,
          header.payload_hash,
          entries.front().key,
          entries.back().key,
          range.min.x,
          range.min.y,
          range.max.x,
          range.max.y,
          n,
          0};
}

void unpack_page(Bytes bytes, std::vector<IndexEntry>& out) {
  const Block block = parse_block(bytes, Kind::kIndexPage);
  flatbuffers::Verifier verifier(reinterpret_cast<const std::uint8_t*>(block.meta.data()), block.meta.size(),
                                 8, 64);
  if (!verifier.VerifyBuffer<fbs::IndexPage>(nullptr)) fail("an index page is malformed");
  const std::uint32_t n = flatbuffers::GetRoot<fbs::IndexPage>(block.meta.data())->entries();
  if (n < 1 || n > kPageEntries) fail("an index page has another number of entries than it may");
  const auto columns = std::make_unique_for_overwrite<std::byte[]>(n * sizeof(IndexEntry));
  read_frame(block.body, {columns.get(), n * sizeof(IndexEntry)});
  out.resize(n);
  transpose(columns.get(), n, sizeof(IndexEntry), n, reinterpret_cast<std::byte*>(out.data()),
            sizeof(IndexEntry));
}

void read_page(Bytes bytes, const fbs::PageRef& ref, std::uint64_t end, const TypeTable& types,
               const Root& root, std::vector<IndexEntry>& out) {
  const auto header = read_as<BlockHeader>(bytes);
  if (header.payload_hash != ref.hash() || header.key != ref.first_key())
    fail("an index page is not the one the index names");
  unpack_page(bytes, out);
  const std::size_t n = out.size();
  if (n != ref.entries()) fail("an index page has another number of entries than it says");
  for (std::size_t i = 0; i < n; ++i) {
    check_entry(out[i], end, types, root);
    if (i > 0 && std::pair(out[i - 1].key, out[i - 1].type) >= std::pair(out[i].key, out[i].type)) {
      fail("index entries are not in order");
    }
  }
  const PatchRange covers{{ref.x_min(), ref.y_min()}, {ref.x_max(), ref.y_max()}};
  if (out.front().key != ref.first_key() || out.back().key != ref.last_key() || !(range_of(out) == covers)) {
    fail("an index page does not cover what the index says");
  }
}

void append_root(std::vector<std::byte>& out, const std::vector<fbs::PageRef>& pages,
                 const std::vector<Summary::OfType>& totals, std::uint64_t commit) {
  flatbuffers::FlatBufferBuilder fb(1024 + pages.size() * sizeof(fbs::PageRef));
  std::vector<fbs::TypeTotals> types;
  for (const Summary::OfType& t : totals) {
    types.emplace_back(t.layers, t.stored_bytes, t.raw_bytes,
                       flatbuffers::span<const std::uint64_t, kMaxStep + 1>(t.layers_at));
  }
  const auto pages_at = fb.CreateVectorOfStructs(pages);
  const auto totals_at = fb.CreateVectorOfStructs(types);
  fb.Finish(fbs::CreateIndexRoot(fb, pages_at, totals_at));
  append_block(out, Kind::kIndexRoot, 0, std::as_bytes(std::span(fb.GetBufferPointer(), fb.GetSize())), {},
               commit);
}

namespace {

/// The verifier lets a vector of structs lie at any address: they are copied, never read in place.
template <typename T>
T struct_at(const std::uint8_t* data, std::size_t i) {
  T value;
  std::memcpy(&value, data + i * sizeof(T), sizeof(T));
  return value;
}

void check_ref(const fbs::PageRef& ref, std::uint64_t end) {
  if (ref.offset() < sizeof(Preamble) || ref.offset() % 8 != 0 || ref.offset() > end ||
      ref.bytes() > end - ref.offset() || ref.bytes() > kPageEntries * sizeof(IndexEntry) * 2 + 4096 ||
      ref.reserved() != 0 || ref.entries() < 1 || ref.entries() > kPageEntries ||
      ref.last_key() < ref.first_key()) {
    fail("the index root names a page that cannot be");
  }
}

Summary::OfType totals_of(const fbs::TypeTotals& stored) {
  Summary::OfType of;
  of.layers = stored.layers();
  of.stored_bytes = stored.stored_bytes();
  of.raw_bytes = stored.raw_bytes();
  std::uint64_t sum = 0;
  for (std::size_t k = 0; k < of.layers_at.size(); ++k) {
    of.layers_at[k] = stored.layers_at()->Get(static_cast<flatbuffers::uoffset_t>(k));
    if (of.layers_at[k] > of.layers) fail("the index root's totals do not add up");
    sum += of.layers_at[k];
  }
  if (sum != of.layers) fail("the index root's totals do not add up");
  return of;
}

}  // namespace

Root read_root(Bytes bytes, std::uint64_t end, std::size_t types) {
  const Block block = parse_block(bytes, Kind::kIndexRoot);
  if (!block.body.empty() || block.meta.size() > kMaxRootBytes) fail("the index root is malformed");
  flatbuffers::Verifier verifier(reinterpret_cast<const std::uint8_t*>(block.meta.data()), block.meta.size(),
                                 8, 64);
  if (!verifier.VerifyBuffer<fbs::IndexRoot>(nullptr)) fail("the index root is malformed");
  const auto* root = flatbuffers::GetRoot<fbs::IndexRoot>(block.meta.data());
  const std::size_t pages = root->pages() == nullptr ? 0 : root->pages()->size();
  const std::size_t totals = root->totals() == nullptr ? 0 : root->totals()->size();
  if (totals != types || pages > kMaxPages) fail("the index root does not fit the layer types");
  Root result;
  std::uint64_t entries = 0, layers = 0;
  for (std::size_t i = 0; i < pages; ++i) {
    const auto ref = struct_at<fbs::PageRef>(root->pages()->Data(), i);
    check_ref(ref, end);
    // A patch's layers may stand on both sides of a page's end, so the keys may touch.
    if (i > 0 && ref.first_key() < result.pages.back().last_key()) fail("the index pages are not in order");
    entries += ref.entries();
    result.pages.push_back(ref);
  }
  for (std::size_t i = 0; i < totals; ++i) {
    result.totals.push_back(totals_of(struct_at<fbs::TypeTotals>(root->totals()->Data(), i)));
    if (result.totals.back().layers > entries) fail("the index root's totals do not add up");
    layers += result.totals.back().layers;
  }
  if (layers != entries) fail("the index root's totals do not add up");
  return result;
}

}  // namespace apgm::format
