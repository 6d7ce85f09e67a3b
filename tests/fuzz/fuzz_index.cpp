// Index root and index page, behind right checksums. First byte even: FlatBuffer of a root; odd: 64 bytes an
// entry of a page.

#include "fuzz.hpp"
#include "index.hpp"

namespace {

using namespace apgm;

constexpr std::uint64_t kEnd = 1 << 20;

void read_root(std::span<const std::byte> meta) {
  std::vector<std::byte> block;
  format::append_block(block, format::Kind::kIndexRoot, 0, meta, {});
  const format::Root root = format::read_root(block, kEnd, 2);
  std::vector<std::byte> written;
  format::append_root(written, root.pages, root.totals);
  if (format::read_root(written, kEnd, 2).totals != root.totals) fuzz::fail("a root came back otherwise");
}

void read_page(std::span<const std::byte> bytes) {
  std::vector<format::IndexEntry> entries(
      std::min(bytes.size() / sizeof(format::IndexEntry), std::size_t{5000}));
  if (entries.empty()) return;
  std::memcpy(entries.data(), bytes.data(), entries.size() * sizeof(format::IndexEntry));
  std::vector<std::byte> block;
  const auto ref = format::append_page(block, 64, entries);
  const TypeTable types({LayerType::occupancy(), LayerType::real("z", {"z"})});
  format::Root root;
  root.totals.resize(types.size());
  for (Summary::OfType& of : root.totals) of.layers_at.fill(1);
  std::vector<format::IndexEntry> read;
  format::read_page(block, ref, kEnd, types, root, read);
  if (std::memcmp(read.data(), entries.data(), entries.size() * sizeof(format::IndexEntry)) != 0) {
    fuzz::fail("a page came back otherwise");
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const auto rest = fuzz::bytes_of(data, size).subspan(1);
  fuzz::survives([&] { data[0] % 2 == 0 ? read_root(rest) : read_page(rest); });
  return 0;
}
