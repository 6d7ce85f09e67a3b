#pragma once

#include <span>
#include <vector>

#include "apgm/core/source.hpp"
#include "apgm_generated.h"
#include "block.hpp"

namespace apgm::format {

/// Entries of one page: as many as a file may hold, and as many as are written. Small pages keep a crop of a
/// large map fast (a page is read whole), the root of a map of a million layers still fits 64 KiB.
inline constexpr std::size_t kPageEntries = 4096;
inline constexpr std::size_t kPageEntriesWritten = 1024;
inline constexpr std::uint64_t kMaxPages = std::uint64_t{1} << 20;
inline constexpr std::uint64_t kMaxRootBytes = std::uint64_t{128} << 20;

/// Appends an IndexPage block of `entries` (1 or more, sorted) to `out`, and says what it covers.
/// `offset` is where the block goes in the file.
fbs::PageRef append_page(std::vector<std::byte>& out, std::uint64_t offset,
                         std::span<const IndexEntry> entries, std::uint64_t commit = 1);

struct Root {
  std::vector<fbs::PageRef> pages;
  std::vector<Summary::OfType> totals;
};

/// Entries of a stored page, as they are. @throws Error{kDamaged}
void unpack_page(Bytes block, std::vector<IndexEntry>& out);

/// Entries of a stored page, checked: count, strict order by (key, type), key = curve(ix, iy), blocks within
/// [64, `end`) and no larger than their type and step allow, steps that the totals of `root` know, encoding
/// known.
/// @throws Error{kDamaged|kUnsupported}
void read_page(Bytes block, const fbs::PageRef& ref, std::uint64_t end, const TypeTable& types,
               const Root& root, std::vector<IndexEntry>& out);

void append_root(std::vector<std::byte>& out, const std::vector<fbs::PageRef>& pages,
                 const std::vector<Summary::OfType>& totals, std::uint64_t commit = 1);

/// The pages and totals, checked against each other: ranges of keys and files, sums of layers.
/// @throws Error{kDamaged}
Root read_root(Bytes block, std::uint64_t end, std::size_t types);

}  // namespace apgm::format
