#include <algorithm>
#include <map>
#include <optional>
#include <unordered_map>

#include "apgm/core/error.hpp"
#include "apgm/format/archive.hpp"
#include "append_file.hpp"
#include "archive_target.hpp"
#include "commits.hpp"
#include "file_cursor.hpp"
#include "located.hpp"
#include "map_header.hpp"
#include "preamble.hpp"

namespace apgm {

using namespace format;

namespace {

/// What makes stored layers the same: equal blocks but for the number of the commit.
struct BlockKey {
  std::uint64_t key, payload_hash;
  std::uint32_t bytes;
  friend bool operator==(const BlockKey&, const BlockKey&) = default;
};
struct BlockKeyHash {
  std::size_t operator()(const BlockKey& k) const { return k.payload_hash ^ k.key * 0x9E3779B97F4A7C15u; }
};

/// Copies commits, oldest first, each as its own would have been written.
class Compactor {
 public:
  Compactor(const InputFile& input, OutputFile output, const std::function<bool()>& cancelled)
      : input_(input), cancelled_(cancelled) {
    output_.file.emplace(std::move(output));
    output_.write(bytes_of(make_preamble(true)));
  }

  void copy(const FooterAt& at, bool newest) {
    const OpenCommit commit = open_commit(input_, at);
    Footer footer = at.footer;
    MapHeader header = commit.header;
    if (!newest) header.metadata.erase(kTagsKey);  // they were those of that time
    footer.header_offset = output_.size();
    footer.header_hash = append_map_header(block_, header, footer.commits).payload_hash;
    footer.header_bytes = block_.size();
    write_block();
    std::vector<fbs::PageRef> pages;
    for (const fbs::PageRef& page : commit.root.pages) pages.push_back(copy_page(commit, page));
    const auto [root, is_new] = roots_.try_emplace(at.footer.root_offset);
    if (is_new) {
      root->second.offset = output_.size();
      append_root(block_, pages, commit.root.totals, footer.commits);
      root->second.bytes = block_.size();
      root->second.hash = read_as<BlockHeader>(block_).payload_hash;
      write_block();
    }
    footer.root_offset = root->second.offset;
    footer.root_bytes = root->second.bytes;
    footer.root_hash = root->second.hash;
    footer.previous_footer = last_footer_;
    last_footer_ = output_.size();
    footer.file_bytes = last_footer_ + kFooterBlockBytes;
    output_.write(footer_block(footer));
  }

  std::uint64_t size() const { return output_.size(); }
  void finish() { output_.file->commit(); }

 private:
  struct Place {
    std::uint64_t offset = 0, bytes = 0, hash = 0;
  };

  void write_block() {
    output_.write(block_);
    block_.clear();
  }

  /// Pages that commits shared are shared again.
  fbs::PageRef copy_page(const OpenCommit& commit, const fbs::PageRef& page) {
    if (const auto known = pages_.find(page.offset()); known != pages_.end()) return known->second;
    buffer_.resize(page.bytes());
    input_.read(page.offset(), buffer_);
    std::vector<IndexEntry> entries;
    located(input_, page.offset(), "", [&] {
      read_page(buffer_, page, commit.at.footer.root_offset, commit.header.types, commit.root, entries);
    });
    for (IndexEntry& entry : entries) entry.offset = copy_layer(commit, entry);
    const fbs::PageRef copied = append_page(block_, output_.size(), entries, commit.at.footer.commits);
    write_block();
    pages_.emplace(page.offset(), copied);
    return copied;
  }

  /// Where the layer lies in the new file.
  std::uint64_t copy_layer(const OpenCommit& commit, const IndexEntry& e) {
    const auto [known, is_new] = blocks_.try_emplace({e.key, e.stored_hash, e.stored_bytes}, output_.size());
    if (!is_new) return known->second;
    if (cancelled_ && cancelled_()) throw Error(ErrorCode::kCancelled, "cancelled");
    const LayerInfo info{{e.ix, e.iy},   e.type,         e.step,     e.encoding,
                         e.stored_bytes, e.content_hash, e.stamp_ns, e.offset};
    const std::string name = name_of(info.patch, commit.header.types[e.type].name);
    located(
        input_, e.offset, name, [&] { read_layer(input_, info, layer_); }, kSalvage);
    renumber_block(layer_, commit.at.footer.commits);
    output_.write(layer_);
    return known->second;
  }

  const InputFile& input_;
  const std::function<bool()>& cancelled_;
  OutputBlocks output_;
  std::vector<std::byte> block_, buffer_, layer_;
  std::unordered_map<BlockKey, std::uint64_t, BlockKeyHash> blocks_;
  std::unordered_map<std::uint64_t, fbs::PageRef> pages_;  // by where they are in the old file
  std::unordered_map<std::uint64_t, Place> roots_;         // the same
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

CompactReport compact(const InputFile& input, const FooterAt& last, OutputFile output,
                      const CompactOptions& options) {
  const std::vector<FooterAt> commits = last_of_each(footer_chain(input, last));
  const MapHeader newest = header_of(input, last);
  const Tags tags = located(input, last.footer.header_offset, "", [&] { return tags_of(newest); });
  const std::vector<FooterAt> chosen = kept(commits, options.keep, tags);
  Compactor compactor(input, std::move(output), options.cancelled);
  for (const FooterAt& at : chosen) compactor.copy(at, at.offset == last.offset);
  const CompactReport report{commits.size(), chosen.size(), input.size(), compactor.size()};
  compactor.finish();
  return report;
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
    return report;
  }
  check_not_an_input(options.output, std::span(&archive, 1));
  const InputFile input(archive);
  check_is_archive(input);
  return compact(input, find_last_footer(input, true).last, OutputFile(options.output, output), options);
}

}  // namespace apgm
