#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <unordered_map>

#include "apgm/core/budget.hpp"
#include "apgm/core/error.hpp"
#include "apgm/format/archive.hpp"
#include "append_file.hpp"
#include "archive_target.hpp"
#include "commits.hpp"
#include "content_id.hpp"
#include "file_cursor.hpp"
#include "located.hpp"
#include "map_header.hpp"
#include "preamble.hpp"

namespace apgm {

using namespace format;

namespace {

/// What makes stored layers the same: equal blocks but for the number of the commit, of types that mean the
/// same.
struct BlockKey {
  std::uint64_t key, payload_hash, space, content_hash;
  std::int64_t stamp_ns;
  std::uint32_t bytes;
  TypeId type;
  std::uint8_t step, encoding;
  friend bool operator==(const BlockKey&, const BlockKey&) = default;
};
struct BlockKeyHash {
  std::size_t operator()(const BlockKey& k) const { return k.payload_hash ^ k.key * 0x9E3779B97F4A7C15u; }
};

// Memory, of what an allocator gives: nodes of the two tables with their share of the buckets while these
// grow, and what a page and an output need at work.
constexpr std::uint64_t kBytesALayer = 112;
constexpr std::uint64_t kBytesAPage = 192;
constexpr std::uint64_t kBytesAtWork = std::uint64_t{2} << 20;
constexpr const char* kTooMuch = "the list of the layers of all commits is held in memory";

/// Copies commits, oldest first, each as its own would have been written.
class Compactor {
 public:
  Compactor(const InputFile& input, OutputFile output, const CompactOptions& options)
      : input_(input), options_(options) {
    output_.file.emplace(std::move(output));
    output_.write(bytes_of(make_preamble(true)));
  }

  void copy(const FooterAt& at, bool newest) {
    // Both are read as a whole, and taken apart.
    check_held(4 * (at.footer.header_bytes + at.footer.root_bytes));
    try {
      copy_commit(at, newest);
    } catch (Error& e) {
      const std::string number = std::to_string(at.footer.commits);
      if (e.code() == ErrorCode::kDamaged) {
        e.hint("'apgm-archive checkout --salvage --at " + number + "' saves what is whole of commit " +
               number + ", 'compact --keep' leaves old commits out");
      }
      throw;
    }
  }

  std::uint64_t size() const { return output_.size(); }
  void finish() { output_.file->commit(); }

 private:
  struct Place {
    std::uint64_t offset = 0, bytes = 0, hash = 0;
  };
  struct CopiedPage {
    fbs::PageRef from, to;
  };
  struct CopiedRoot {
    std::vector<fbs::PageRef> pages;
    std::vector<Summary::OfType> totals;
    Place place;
  };

  void copy_commit(const FooterAt& at, bool newest) {
    const OpenCommit commit = open_commit(input_, at);
    Footer footer = at.footer;
    MapHeader header = commit.header;
    if (!newest) header.metadata.erase(kTagsKey);  // they were those of that time
    footer.header_offset = output_.size();
    footer.header_hash = append_map_header(block_, header, footer.commits).payload_hash;
    footer.header_bytes = block_.size();
    write_block();
    const Place root = copy_index(commit);
    footer.root_offset = root.offset;
    footer.root_bytes = root.bytes;
    footer.root_hash = root.hash;
    footer.previous_footer = last_footer_;
    last_footer_ = output_.size();
    footer.file_bytes = last_footer_ + kFooterBlockBytes;
    output_.write(footer_block(footer));
  }

  /// @param more  that is about to be taken
  void check_held(std::uint64_t more) const {
    if (options_.max_memory_bytes == 0) return;
    const std::uint64_t roots = root_ ? 3 * root_->pages.size() * sizeof(fbs::PageRef) : 0;
    check_budget(options_.max_memory_bytes,
                 kBytesAtWork + blocks_.size() * kBytesALayer + pages_.size() * kBytesAPage + roots + more,
                 kTooMuch);
  }

  void write_block() {
    output_.write(block_);
    block_.clear();
  }

  /// The pages and the root; checks that they are what the footer's content id says.
  Place copy_index(const OpenCommit& commit) {
    ContentId id(commit.header);
    std::vector<std::uint64_t> spaces;
    for (const LayerType& type : commit.header.types) spaces.push_back(space_hash(type));
    if (spaces != spaces_) pages_.clear();  // what they list means something else
    spaces_ = std::move(spaces);
    last_place_.reset();
    std::vector<fbs::PageRef> pages;
    for (const fbs::PageRef& page : commit.root.pages) pages.push_back(copy_page(commit, page, id));
    if (id.value() != commit.at.footer.content_id) {
      fail_damaged(input_, commit.at.offset,
                   "commit " + std::to_string(commit.at.footer.commits) + " is not what its content id says");
    }
    if (!root_ || !same_pages(root_->pages, pages) || root_->totals != commit.root.totals) {
      root_ = {pages, commit.root.totals, {}};
      root_->place.offset = output_.size();
      append_root(block_, pages, commit.root.totals, commit.at.footer.commits);
      root_->place.bytes = block_.size();
      root_->place.hash = read_as<BlockHeader>(block_).payload_hash;
      write_block();
    }
    return root_->place;
  }

  static bool same_pages(std::span<const fbs::PageRef> a, std::span<const fbs::PageRef> b) {
    return std::ranges::equal(std::as_bytes(a), std::as_bytes(b));
  }

  /// Pages that commits shared are shared again; each is read and checked for each commit.
  fbs::PageRef copy_page(const OpenCommit& commit, const fbs::PageRef& page, ContentId& id) {
    buffer_.resize(page.bytes());
    input_.read(page.offset(), buffer_);
    std::vector<IndexEntry> entries;
    located(input_, page.offset(), "", [&] {
      read_page(buffer_, page, commit.at.footer.root_offset, commit.header.types, commit.root, entries);
    });
    const std::pair first(entries.front().key, entries.front().type);
    if (last_place_ && *last_place_ >= first) {
      fail_damaged(input_, page.offset(), "index entries are not in order");
    }
    last_place_.emplace(entries.back().key, entries.back().type);
    std::uint64_t largest = 0;
    for (const IndexEntry& e : entries) {
      id.add({e.ix, e.iy}, e.type, e.step, e.content_hash);
      largest = std::max<std::uint64_t>(largest, e.stored_bytes);
    }
    const auto known = pages_.find(page.offset());
    if (known != pages_.end() && same_pages({&known->second.from, 1}, {&page, 1})) return known->second.to;
    check_held(entries.size() * kBytesALayer + 2 * largest);
    for (IndexEntry& entry : entries) entry.offset = copy_layer(commit, entry);
    if (options_.progress) options_.progress(std::min(output_.size(), input_.size()), input_.size());
    const fbs::PageRef copied = append_page(block_, output_.size(), entries, commit.at.footer.commits);
    write_block();
    pages_.insert_or_assign(page.offset(), CopiedPage{page, copied});
    return copied;
  }

  /// Where the layer lies in the new file.
  std::uint64_t copy_layer(const OpenCommit& commit, const IndexEntry& e) {
    const BlockKey key{e.key,          e.stored_hash, spaces_[e.type], e.content_hash, e.stamp_ns,
                       e.stored_bytes, e.type,        e.step,          e.encoding};
    const auto [known, is_new] = blocks_.try_emplace(key, output_.size());
    if (!is_new) return known->second;
    if (options_.cancelled && options_.cancelled()) throw Error(ErrorCode::kCancelled, "cancelled");
    const LayerInfo info{{e.ix, e.iy},   e.type,         e.step,     e.encoding,
                         e.stored_bytes, e.content_hash, e.stamp_ns, e.offset};
    const std::string name = name_of(info.patch, commit.header.types[e.type].name);
    located(input_, e.offset, name, [&] {
      read_layer(input_, info, layer_);
      if (read_as<BlockHeader>(layer_).payload_hash == e.stored_hash) return;
      throw Error(ErrorCode::kDamaged, "the block is not the one the index names");
    });
    renumber_block(layer_, commit.at.footer.commits);
    output_.write(layer_);
    return known->second;
  }

  const InputFile& input_;
  const CompactOptions& options_;
  OutputBlocks output_;
  std::vector<std::byte> block_, buffer_, layer_;
  std::unordered_map<BlockKey, std::uint64_t, BlockKeyHash> blocks_;
  std::unordered_map<std::uint64_t, CopiedPage> pages_;         // by where they are in the old file
  std::vector<std::uint64_t> spaces_;                           // of the commit's types
  std::optional<CopiedRoot> root_;                              // the last
  std::optional<std::pair<std::uint64_t, TypeId>> last_place_;  // of the commit's entries so far
  std::uint64_t last_footer_ = 0;
};

/// The newest commits and those with tags.
std::vector<FooterAt> kept(const std::vector<FooterAt>& commits, std::uint64_t keep, const Tags& tags) {
  if (keep == 0 || keep >= commits.size()) return commits;
  std::vector<FooterAt> result;
  for (std::size_t i = 0; i < commits.size(); ++i) {
    const bool tagged =
        std::ranges::any_of(tags, [&](const auto& tag) { return tag.second == commits[i].footer.commits; });
    if (tagged || commits.size() - i <= keep) result.push_back(commits[i]);
  }
  return result;
}

/// Before any of them is read: no commit added more layers than it has, nor more than its bytes hold.
void check_layers(const std::vector<FooterAt>& commits, std::uint64_t max_memory_bytes) {
  constexpr std::uint64_t kLeastBlockBytes = 128;
  std::uint64_t layers = 0, from = 0;
  for (const FooterAt& at : commits) {
    layers += std::min(at.footer.layers, (at.end() - from) / kLeastBlockBytes);
    from = at.end();
  }
  check_budget(max_memory_bytes, kBytesAtWork + layers * kBytesALayer, kTooMuch);
}

CompactReport compact(const InputFile& input, const FooterAt& last, OutputFile output,
                      const CompactOptions& options) {
  const std::vector<FooterAt> commits = last_of_each(footer_chain(input, last));
  const MapHeader newest = header_of(input, last);
  const Tags tags = located(input, last.footer.header_offset, "", [&] { return tags_of(newest); });
  const std::vector<FooterAt> chosen = kept(commits, options.keep, tags);
  check_layers(chosen, options.max_memory_bytes);
  Compactor compactor(input, std::move(output), options);
  for (const FooterAt& at : chosen) compactor.copy(at, at.offset == last.offset);
  const CompactReport report{commits.size(), chosen.size(), input.size(), compactor.size(), {}};
  compactor.finish();
  return report;
}

/// A pipe would be waited for, and what goes to one is no archive.
void check_is_no_device(const std::string& path) {
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status) || std::filesystem::is_regular_file(status) ||
      std::filesystem::is_directory(status)) {
    return;
  }
  throw no_regular_file(path);
}

}  // namespace

CompactReport compact_archive(const std::string& archive, const CompactOptions& options) {
  OutputOptions output{.overwrite = options.output.empty() || options.overwrite, .fsync = true};
  if (options.output.empty()) {
    LockedFile file(archive);  // until the new file has the name
    const InputFile whole(file, file.size(), archive);
    const std::uint64_t before = whole.size();
    AppendTarget target(file, archive);
    CompactReport report = compact(*target.input(), target.base()->at, OutputFile(archive, output), options);
    report.file_bytes_before = before;
    report.torn = target.torn();
    return report;
  }
  check_not_an_input(options.output, std::span(&archive, 1));
  check_is_no_device(options.output);
  const InputFile input(archive);
  check_is_archive(input);
  const Tail tail = find_last_footer(input, true);
  CompactReport report = compact(input, tail.last, OutputFile(options.output, output), options);
  report.torn = torn_end(input, tail);
  return report;
}

}  // namespace apgm
