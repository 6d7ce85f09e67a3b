// Mutates .apgm files behind their checksums. Bytes changed at random fail a hash and go no further; so the
// file is taken apart, one of its parts is changed, and offsets, sizes and hashes are made to fit again.

#include <algorithm>
#include <random>

#include "fuzz.hpp"
#include "loose_file.hpp"

namespace apgm::fuzz {
namespace {

using Block = LooseFile::Block;
using Random = std::minstd_rand;

/// Lets libFuzzer change `bytes`, which may grow by `more`.
void mutate(std::vector<std::byte>& bytes, std::size_t more) {
  const std::size_t size = bytes.size();
  bytes.resize(size + more);
  bytes.resize(LLVMFuzzerMutate(reinterpret_cast<std::uint8_t*>(bytes.data()), size, size + more));
}

/// Changes the bytes of a value that keeps its size.
template <typename T>
void mutate_value(T& value) {
  LLVMFuzzerMutate(reinterpret_cast<std::uint8_t*>(&value), sizeof(T), sizeof(T));
}

/// Changes one number of a struct in place: most changes of many bytes at once are met by the first check.
void mutate_field(std::span<std::byte> bytes, Random& random) {
  if (bytes.size() < 8) return;
  const std::size_t width = std::size_t{1} << (random() % 4);
  auto* at = reinterpret_cast<std::uint8_t*>(bytes.data()) + random() % (bytes.size() / width) * width;
  LLVMFuzzerMutate(at, width, width);
}

void mutate_entries(Block& page, Random& random) {
  auto& entries = page.entries;
  switch (random() % 5) {
    case 0:
      if (entries.size() > 1) entries.erase(entries.begin() + random() % entries.size());
      return;
    case 1:
      if (entries.size() < 5000) entries.push_back(entries[random() % entries.size()]);
      return;
    case 2:
      std::swap(entries[random() % entries.size()], entries[random() % entries.size()]);
      return;
    default: {
      auto& entry = entries[random() % entries.size()];
      mutate_field(std::as_writable_bytes(std::span(&entry, 1)), random);
    }
  }
}

/// Changes what a block holds. Returns true if what it says of other blocks is to stay as it says now.
bool mutate_payload(LooseFile& file, Block& block, Random& random) {
  using format::Kind;
  const Kind kind = block.header.kind;
  if (kind == Kind::kIndexPage && !block.entries.empty()) {
    mutate_entries(block, random);
    return random() % 2 == 0;
  }
  if (kind == Kind::kFooter || (kind == Kind::kIndexRoot && random() % 2 == 0)) {
    mutate_field(block.payload, random);
    return random() % 2 == 0;
  }
  mutate(block.payload, 64);
  if (random() % 2 == 0) {
    // A body that is longer or shorter leaves the FlatBuffer before it alone.
    block.header.meta_bytes = static_cast<std::uint32_t>(
        std::min<std::size_t>(block.header.meta_bytes, block.payload.size() / 8 * 8));
  }
  if (kind == Kind::kLayer && random() % 4 != 0) file.rehash_cells(block);
  return false;
}

void change_order(std::vector<Block>& blocks, Random& random) {
  const std::size_t i = random() % blocks.size(), k = random() % blocks.size();
  switch (random() % 3) {
    case 0:
      if (blocks.size() > 1) blocks.erase(blocks.begin() + static_cast<std::ptrdiff_t>(i));
      return;
    case 1:
      if (blocks.size() < 200)
        blocks.insert(blocks.begin() + static_cast<std::ptrdiff_t>(k), Block(blocks[i]));
      return;
    default:
      std::swap(blocks[i], blocks[k]);
  }
}

std::vector<std::byte> mutate_file(LooseFile& file, Random& random) {
  auto& blocks = file.blocks();
  Block& block = blocks[random() % blocks.size()];
  switch (random() % 8) {
    case 0:
      mutate_value(file.preamble());
      return file.link();
    case 1:
      mutate_field(std::as_writable_bytes(std::span(&block.header, 1)), random);
      return file.link();
    case 2:
      change_order(blocks, random);
      return file.link();
    default:
      return mutate_payload(file, block, random) ? file.link(&block) : file.link();
  }
}

}  // namespace
}  // namespace apgm::fuzz

/// For libFuzzer: the name and the types are its own.
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  using namespace apgm::fuzz;
  Random random(seed);
  if (random() % 8 == 0) return LLVMFuzzerMutate(data, size, max_size);
  auto file = LooseFile::parse(bytes_of(data, size));
  if (!file) return LLVMFuzzerMutate(data, size, max_size);
  const auto bytes = mutate_file(*file, random);
  if (bytes.size() > max_size) return LLVMFuzzerMutate(data, size, max_size);
  std::memcpy(data, bytes.data(), bytes.size());
  return bytes.size();
}
