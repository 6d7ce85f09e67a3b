#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "apgm/core/map.hpp"
#include "apgm_generated.h"

namespace apgm::test {

// The structs of docs/format.md once more, apart from those of the library: what the corpus is made with must
// not follow the library's mistakes.

struct Preamble {
  std::array<char, 8> magic;
  std::uint16_t major, minor;
  std::uint32_t incompat, ro_compat, compat;
  std::array<char, 32> reserved;
  std::uint64_t hash;
};
static_assert(sizeof(Preamble) == 64);

struct BlockHead {
  std::array<char, 8> sync{'A', 'P', 'G', 'M', 'B', 'L', 'K', '1'};
  std::uint8_t kind = 0, flags = 0;
  std::uint16_t version = 1;
  std::uint32_t m = 0;
  std::uint64_t p = 0, key = 0, commit = 1, payload_hash = 0, reserved = 0, hash = 0;
};
static_assert(sizeof(BlockHead) == 64);

struct Entry {
  std::uint64_t key = 0, offset = 0, content_hash = 0, payload_hash = 0;
  std::int64_t stamp_ns = 0;
  std::int32_t ix = 0, iy = 0;
  std::uint32_t bytes = 0;
  std::uint16_t type = 0;
  std::uint8_t step = 0, encoding = 0;
  std::uint64_t reserved = 0;
};
static_assert(sizeof(Entry) == 64);

struct Footer {
  std::uint64_t header_offset = 0, header_bytes = 0, header_hash = 0;
  std::uint64_t root_offset = 0, root_bytes = 0, root_hash = 0;
  std::uint64_t patches = 0, layers = 0;
  std::array<std::byte, 16> content_id{};
  std::int32_t x_min = 0, y_min = 0, x_max = -1, y_max = -1;
  std::uint64_t file_bytes = 0, previous = 0, commits = 1;
  std::array<std::uint64_t, 8> reserved{};
  std::array<char, 8> end{'A', 'P', 'G', 'M', 'E', 'N', 'D', '1'};
};
static_assert(sizeof(Footer) == 192);

enum : std::uint8_t { kMapHeader = 1, kLayer = 2, kIndexPage = 3, kIndexRoot = 4, kFooter = 5 };

/// A layer that is to be stored. Offset, size and payload hash of its entry are found by `put_together`.
struct StoredPart {
  Entry entry;
  float error_bound = 0;
  std::string body;
};

/// A file in pieces that can be changed one by one.
struct Parts {
  MapHeader header;        ///< for the content id
  std::string map_header;  ///< FlatBuffer; made of `header` where empty
  std::vector<StoredPart> layers;
  std::size_t page_entries = 1024;
};

/// Where `put_together` lets a fault in; each runs before the hashes over what it sees are made.
struct Hooks {
  std::function<void(Preamble&)> preamble;
  /// Payload of every block. The head holds kind, key and M; P and the hash follow from what is left here.
  std::function<void(BlockHead&, std::string& payload)> payload;
  std::function<void(BlockHead&)> head;
  /// A whole block with its padding; nothing is hashed any more.
  std::function<void(const BlockHead&, std::string& block)> block;
  std::function<void(std::vector<Entry>&)> page;
  std::function<void(std::vector<fbs::PageRef>&, std::vector<fbs::TypeTotals>&)> root;
  std::function<void(Footer&)> footer;
  /// What stands before a block: other blocks, or nothing that should be there.
  std::function<std::string(std::uint8_t kind)> before;
};

/// Whole file from its pieces.
std::string put_together(const Parts& parts, const Hooks& hooks = {});

/// An archive that grows commit by commit.
struct ArchiveParts {
  std::string bytes;
  std::uint64_t next_number = 1;
  std::uint64_t last_footer = 0;  ///< its offset; 0: none
  Footer footer;                  ///< the last
  std::vector<Entry> entries;     ///< of the last commit

  /// A layer of the last commit, to be named by the next one instead of being stored again.
  StoredPart shared(std::size_t i) const { return {entries.at(i), 0, {}}; }
};

/// Adds a commit. Parts whose entry has an offset are named where they are.
void append_commit(ArchiveParts& archive, const Parts& parts, const Hooks& hooks = {});
/// Adds a MapHeader and a Footer that replace the header of the last commit.
void replace_header(ArchiveParts& archive, const MapHeader& header, const Hooks& hooks = {});

/// A block of any kind, with right hashes; for `Hooks::before`.
std::string make_block(BlockHead head, const std::string& payload);

/// MapHeader with all that can be said wrong in it. Lists are given as they are stored: joined by spaces.
struct RawType {
  std::string name = "occupancy", hypotheses = "O F", channels = "O F", policy = "conditional";
  bool has_slab = false;
  std::int64_t z_min_um = 0, z_max_um = 0;
};
struct RawHeader {
  std::int64_t edge_um = 12'800'000, datum_x_um = 0, datum_y_um = 0;
  std::int32_t epsg = 0;
  std::string frame_id = "map";
  std::vector<RawType> types{RawType{}};
  std::vector<std::pair<std::string, std::string>> metadata;
  std::vector<std::array<std::string, 3>> history;
  std::int64_t stamp_ns = 0;
  bool shares_values = false;  ///< equal values of metadata are stored once
};
std::string map_header_flat(const RawHeader& header);
RawHeader raw(const MapHeader& header);

}  // namespace apgm::test
