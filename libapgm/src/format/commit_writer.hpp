#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "apgm/core/source.hpp"
#include "block.hpp"
#include "content_id.hpp"
#include "index.hpp"

namespace apgm::format {

/// Where blocks go, one after the other.
class BlockOutput {
 public:
  virtual ~BlockOutput() = default;
  /// @throws Error{kOutput}
  virtual void write(Bytes bytes) = 0;
  /// Offset of what is written next.
  virtual std::uint64_t size() const = 0;
};

/// The blocks of one commit: MapHeader, layers, index pages and root, and what its footer says. Of a sealed
/// file that is all of it but preamble and footer.
///
/// Entries come in index order. Where nothing but the entries of a page of an earlier commit came between
/// `start_page` and the next, that page is named instead of written again; a page that differs is rewritten,
/// small ones together with the next. Memory: a page, and the list of pages.
class CommitWriter {
 public:
  /// @param output  outlives it
  /// @param number  of the commit
  /// @param header  as it is to be stored; written with the first block
  /// @throws Error{kInvalidArgument|kLimit} on a header that cannot be stored; nothing is then written
  CommitWriter(BlockOutput& output, std::uint64_t number, const MapHeader& header);

  void write_header();
  /// Writes the block of a packed layer and lists it.
  void add(const Parcel& parcel);
  /// Lists a layer that an earlier commit wrote.
  void add_stored(const IndexEntry& entry) { list(entry); }
  /// From here on come the entries of `page`.
  void start_page(const fbs::PageRef& page);
  /// The page started last is not the same any more.
  void touch() { touched_ = true; }

  /// Writes the rest of the index; the footer that then follows, without its predecessor.
  /// @param shared  footer and root of an earlier commit: where the index is the same its root is named
  Footer finish(const Footer* shared_footer = nullptr, const Root* shared_root = nullptr);

  std::uint64_t layers() const { return footer_.layers; }
  std::uint64_t patches() const { return footer_.patches; }

 private:
  void list(const IndexEntry& entry);
  void write_block();
  void flush_page(std::size_t entries);
  void close_page(bool last);
  bool same_index(const Root& root) const;

  BlockOutput& output_;
  TypeTable types_;
  ContentId id_;
  Footer footer_;
  PatchRange range_;
  std::vector<Summary::OfType> totals_;
  std::vector<fbs::PageRef> pages_;
  std::vector<IndexEntry> page_;
  std::optional<fbs::PageRef> stored_page_;
  bool touched_ = true;
  std::optional<PatchIndex> last_patch_;
  std::vector<std::byte> block_;
};

/// The block of a footer.
std::vector<std::byte> footer_block(const Footer& footer);

}  // namespace apgm::format
