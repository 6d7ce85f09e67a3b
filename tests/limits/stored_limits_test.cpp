// Both sides of the limits of docs/format.md that are met in files no writer makes: what is allowed is read,
// one more is refused. Files are made by the pieces of tests/conformance.
#include <gtest/gtest.h>
#include <xxhash.h>

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <span>
#include <string>

#include "apgm/core/error.hpp"
#include "apgm/format/reader.hpp"
#include "apgm/format/verify.hpp"
#include "commit_writer.hpp"
#include "index.hpp"
#include "tests/conformance/small_map.hpp"
#include "tests/support/refusal.hpp"

namespace apgm::test {
namespace {

constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;

std::span<const std::byte> bytes_of(const std::string& file) { return std::as_bytes(std::span(file)); }

void expect_damaged(const std::string& file) {
  EXPECT_EQ(refusal([&] { const Reader reader(bytes_of(file)); }), ErrorCode::kDamaged);
}

/// Layers that can be loaded.
std::uint64_t layers_in(const Reader& reader, const std::optional<PatchRange>& range = {}) {
  std::uint64_t layers = 0;
  PatchInfo patch;
  Layer cells;
  for (const auto cursor = reader.patches(range); cursor->next(patch);) {
    for (const LayerInfo& info : patch.layers) {
      reader.load(info, cells);
      ++layers;
    }
  }
  return layers;
}

void expect_whole(const std::string& file, std::uint64_t layers) {
  const Reader reader(bytes_of(file));
  EXPECT_EQ(layers_in(reader), layers);
  VerifyOptions options;
  options.deep = true;
  const VerifyReport report = verify(bytes_of(file), options);
  EXPECT_TRUE(report.valid()) << (report.problems.empty() ? "" : report.problems[0].text);
}

/// Zeros behind the FlatBuffer of each block of `kind`, which then has `bytes`.
Hooks with_flatbuffers_of(std::uint8_t kind, std::uint32_t bytes) {
  Hooks hooks;
  hooks.payload = [=](BlockHead& head, std::string& payload) {
    if (head.kind != kind) return;
    payload.insert(head.m, bytes - head.m, '\0');
    head.m = bytes;
  };
  return hooks;
}

/// One constant layer of one cell in each of `n` patches, all in one page.
std::string with_page_of(std::size_t n) {
  Parts parts;
  parts.header.types = TypeTable({LayerType::real("z", {"z"})});
  parts.page_entries = n;
  for (std::size_t i = 0; i < n; ++i) {
    const PatchIndex patch{static_cast<std::int32_t>(i % 64), static_cast<std::int32_t>(i / 64)};
    parts.layers.push_back(stored_constant(patch, 0, 0, {bits(static_cast<float>(i + 1))}));
  }
  std::ranges::sort(parts.layers, {}, [](const StoredPart& part) {
    return curve_key({part.entry.ix, part.entry.iy});
  });
  return put_together(parts);
}

TEST(IndexLimits, EntriesOfAPage) {
  expect_whole(with_page_of(4096), 4096);
  expect_damaged(with_page_of(4097));
}

/// Pages of one entry each. All but the last layer's are the first one named again: there are as many as the
/// index says, though whoever reads them all finds that they are one.
std::string with_pages(std::uint64_t n) {
  Parts parts;
  parts.header.types = TypeTable({LayerType::real("z", {"z"})});
  parts.page_entries = 1;
  parts.layers = {stored_constant({0, 0}, 0, 0, {bits(1)}), stored_constant({0, 1}, 0, 0, {bits(2)})};
  Hooks hooks;
  hooks.root = [=](std::vector<fbs::PageRef>& pages, std::vector<fbs::TypeTotals>& totals) {
    const fbs::TypeTotals one = totals[0];
    pages.reserve(n);
    pages.insert(pages.begin(), n - pages.size(), fbs::PageRef(pages.front()));
    std::array<std::uint64_t, 12> steps{n};
    totals[0] = {n, one.stored_bytes(), one.raw_bytes(), flatbuffers::span<const std::uint64_t, 12>(steps)};
  };
  hooks.footer = [=](Footer& footer) { footer.layers = n; };
  return put_together(parts, hooks);
}

TEST(IndexLimits, PagesThatAreRead) {
  {
    const std::string file = with_pages(format::kMaxPages);
    const Reader reader(bytes_of(file));
    EXPECT_EQ(layers_in(reader, PatchRange{{0, 1}, {0, 1}}), 1u);
  }
  expect_damaged(with_pages(format::kMaxPages + 1));
}

/// Keeps the last block alone.
struct LastBlock final : format::BlockOutput {
  void write(format::Bytes block) override {
    last.assign(block.begin(), block.end());
    offset += block.size();
  }
  std::uint64_t size() const override { return offset; }
  std::vector<std::byte> last;
  std::uint64_t offset = 0;
};

/// The pages a commit names that writes none itself, but for the last if that one is touched.
std::uint64_t pages_written(std::uint64_t n, bool touch_last) {
  MapHeader header;
  header.types = TypeTable({LayerType::real("z", {"z"})});
  LastBlock file;
  format::CommitWriter writer(file, 2, header);
  writer.write_header();
  const std::uint64_t earlier = 64;  // place of every layer and page, in a commit before
  for (std::uint64_t i = 0; i < n; ++i) {
    const auto x = static_cast<std::int32_t>(i);
    writer.start_page({earlier, 128, 0, i, i, x, 0, x, 0, 1, 0});
    if (touch_last && i + 1 == n) writer.touch();
    writer.add_stored({.key = i, .offset = earlier, .ix = x, .stored_bytes = 128});
  }
  writer.finish();
  return format::read_root(file.last, file.offset, 1).pages.size();
}

TEST(IndexLimits, PagesThatAreWritten) {
  EXPECT_EQ(pages_written(format::kMaxPages, false), format::kMaxPages);
  EXPECT_EQ(pages_written(format::kMaxPages, true), format::kMaxPages);
  EXPECT_EQ(refusal([] { pages_written(format::kMaxPages + 1, true); }), ErrorCode::kLimit);
  EXPECT_EQ(refusal([] { pages_written(format::kMaxPages + 1, false); }), ErrorCode::kLimit);
}

/// Entries of the pages a commit names that changes the first of two pages of an earlier one, which then
/// has `n` entries; the second keeps its ten.
std::vector<std::uint32_t> pages_after_change(std::uint64_t n) {
  MapHeader header;
  header.types = TypeTable({LayerType::real("z", {"z"})});
  LastBlock file;
  format::CommitWriter writer(file, 2, header);
  writer.write_header();
  const std::uint64_t earlier = 64;
  std::uint64_t key = 0;
  for (const std::uint64_t entries : {n, std::uint64_t{10}}) {
    const auto x0 = static_cast<std::int32_t>(key), x1 = static_cast<std::int32_t>(key + entries - 1);
    writer.start_page(
        {earlier, 128, 0, key, key + entries - 1, x0, 0, x1, 0, static_cast<std::uint32_t>(entries), 0});
    if (entries == n) writer.touch();
    for (std::uint64_t i = 0; i < entries; ++i, ++key) {
      writer.add_stored(
          {.key = key, .offset = earlier, .ix = static_cast<std::int32_t>(key), .stored_bytes = 128});
    }
  }
  writer.finish();
  std::vector<std::uint32_t> counts;
  for (const auto& page : format::read_root(file.last, file.offset, 1).pages)
    counts.push_back(page.entries());
  return counts;
}

TEST(IndexLimits, PagesThatAreSplitAndJoined) {
  using Counts = std::vector<std::uint32_t>;
  EXPECT_EQ(pages_after_change(2047), (Counts{2047, 10}));
  EXPECT_EQ(pages_after_change(2048), (Counts{1024, 1024, 10}));
  EXPECT_EQ(pages_after_change(128), (Counts{128, 10}));
  EXPECT_EQ(pages_after_change(127), (Counts{137}));
}

// Of the 128 MiB the pages take 72 at most: the rest is left to what later versions may add.
TEST(IndexLimits, BytesOfTheRoot) {
  const std::vector<Summary::OfType> totals(1);
  std::vector<std::byte> root;
  format::append_root(root, {}, totals);
  const auto flat = static_cast<std::ptrdiff_t>(root.size());
  root.resize(sizeof(format::BlockHeader) + 128 * kMiB + 8);
  const auto read = [&](std::uint64_t bytes) {
    auto header = format::read_as<format::BlockHeader>(root);
    header.meta_bytes = static_cast<std::uint32_t>(bytes);
    header.payload_bytes = bytes;
    header.payload_hash = XXH3_64bits(root.data() + sizeof(header), bytes);
    std::ranges::copy(format::bytes_of(header), root.begin());
    const auto block = std::span(root).first(sizeof(header) + bytes);
    format::restamp(block, header.commit, header.context);
    return format::read_root(block, 64, totals.size());
  };
  EXPECT_TRUE(std::all_of(root.begin() + flat, root.end(), [](std::byte b) { return b == std::byte{0}; }));
  EXPECT_TRUE(read(128 * kMiB).pages.empty());
  EXPECT_EQ(refusal([&] { read(128 * kMiB + 8); }), ErrorCode::kDamaged);
}

TEST(LayerLimits, FlatBufferOfABlock) {
  expect_whole(put_together(small_map(), with_flatbuffers_of(kLayer, 4096)), 3);
  const std::string more = put_together(small_map(), with_flatbuffers_of(kLayer, 4104));
  const Reader reader(bytes_of(more));
  EXPECT_EQ(refusal([&] { layers_in(reader); }), ErrorCode::kDamaged);
}

/// The frame with blocks of no bytes before its first: as large as one likes.
std::string puffed_up(std::string frame, std::size_t bytes) {
  const std::size_t header = 6;  // magic, descriptor, one byte of content size
  EXPECT_EQ(static_cast<unsigned char>(frame[4]), 0x20) << "another frame header than was thought";
  std::string empty_blocks;
  while (frame.size() + empty_blocks.size() < bytes) empty_blocks += std::string(3, '\0');
  return frame.insert(header, empty_blocks);
}

/// Step 2: values of 128 bytes, so that a block takes 128 + 8 + 16384 at most.
std::string with_block_of(std::size_t bytes) {
  Planes cells(2, std::vector<std::uint32_t>(16));
  cells[0][3] = bits(0.5f);
  const Masked body = masked(small_occupancy(), cells);
  Parts parts = small_map();
  std::string file;
  for (std::size_t frame = bytes - 256; file.empty(); ++frame) {
    parts.layers[0] = stored({0, 0}, 0, 2, 1, cells, body.body(puffed_up(zstd_frame(body.content()), frame)));
    std::size_t stored_bytes = 0;
    Hooks hooks;
    hooks.page = [&](std::vector<Entry>& page) { stored_bytes = page[0].bytes; };
    std::string made = put_together(parts, hooks);
    EXPECT_LE(stored_bytes, bytes);
    if (stored_bytes >= bytes) file = std::move(made);
  }
  return file;
}

TEST(LayerLimits, BytesOfABlock) {
  expect_whole(with_block_of(16'520), 3);
  const std::string more = with_block_of(16'528);
  const Reader reader(bytes_of(more));
  EXPECT_EQ(refusal([&] { layers_in(reader); }), ErrorCode::kDamaged);
}

std::string with_header(const RawHeader& header) {
  Parts parts;
  parts.map_header = map_header_flat(header);
  std::vector<LayerType> types;
  for (const RawType& type : header.types) types.push_back(LayerType::occupancy(type.name));
  // The table holds no more than is allowed; the header is met first.
  types.resize(std::min(types.size(), TypeTable::kMaxTypes));
  parts.header.types = TypeTable(std::move(types));
  return put_together(parts);
}

TEST(StoredHeaderLimits, LayerTypes) {
  RawHeader header;
  header.types.clear();
  for (int i = 0; i < 4096; ++i) header.types.push_back({.name = "t" + std::to_string(10'000 + i)});
  expect_whole(with_header(header), 0);
  header.types.push_back({.name = "u"});
  expect_damaged(with_header(header));
}

TEST(StoredHeaderLimits, InputsOfAHistoryEntry) {
  std::string inputs = "a";
  for (int i = 1; i < 65'536; ++i) inputs += " a";
  RawHeader header;
  header.history = {{"merge", inputs, "{}"}};
  expect_whole(with_header(header), 0);
  header.history[0][1] += " a";
  expect_damaged(with_header(header));
}

TEST(StoredHeaderLimits, BytesOfTheBlock) {
  expect_whole(put_together(small_map(), with_flatbuffers_of(kMapHeader, 16 * kMiB)), 3);
  expect_damaged(put_together(small_map(), with_flatbuffers_of(kMapHeader, 16 * kMiB + 8)));
}

// Strings that share their place: a small header could hold any number of bytes.
TEST(StoredHeaderLimits, BytesOfAllStrings) {
  RawHeader header;
  header.shares_values = true;
  const RawType type;
  std::uint64_t bytes = header.frame_id.size() + type.name.size() + type.hypotheses.size() +
                        type.channels.size() + type.policy.size();
  for (int i = 0; i < 16; ++i) {
    const std::string key = "k" + std::to_string(100 + i);
    const std::uint64_t left = 16 * kMiB - bytes - key.size();
    header.metadata.emplace_back(key, std::string(std::min(left, kMiB), 'v'));
    bytes += key.size() + header.metadata.back().second.size();
  }
  ASSERT_EQ(bytes, 16 * kMiB);
  expect_whole(with_header(header), 0);
  header.metadata.back().second += 'v';
  const std::string more = with_header(header);
  EXPECT_LT(more.size(), 4 * kMiB);
  expect_damaged(more);
}

}  // namespace
}  // namespace apgm::test
