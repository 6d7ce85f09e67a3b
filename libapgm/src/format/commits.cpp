#include "commits.hpp"

#include <algorithm>
#include <charconv>
#include <optional>
#include <string_view>

#include "apgm/core/error.hpp"
#include "apgm/format/archive.hpp"
#include "content_id.hpp"
#include "located.hpp"
#include "map_header.hpp"

namespace apgm {

/// A tag starts with a letter, so that it is never a number or a date.
bool is_tag_name(const std::string& text) {
  constexpr std::size_t kMaxTagName = 64;
  const auto letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; };
  const auto other = [](char c) { return (c >= '0' && c <= '9') || c == '.' || c == '+' || c == '-'; };
  return !text.empty() && text.size() <= kMaxTagName && letter(text[0]) &&
         std::all_of(text.begin(), text.end(), [&](char c) { return letter(c) || other(c); });
}

bool may_be_given(const std::string& tag) { return is_tag_name(tag) && tag != "now"; }

}  // namespace apgm

namespace apgm::format {
namespace {

/// What is read at once from a commit's end: the footer, and for most maps the index root before it.
constexpr std::uint64_t kTailBytes = 64 * 1024;

[[noreturn]] void fail(const char* what) { throw Error(ErrorCode::kDamaged, what); }

/// Blocks before a commit's end; the last of them come with one read.
class BlocksBefore {
 public:
  BlocksBefore(const InputFile& file, std::uint64_t end)
      : file_(file), tail_(std::min(kTailBytes, end)), tail_at_(end - tail_.size()) {
    file.read(tail_at_, tail_);
  }
  std::vector<std::byte> read(std::uint64_t offset, std::uint64_t bytes) const {
    std::vector<std::byte> out(bytes);
    if (offset >= tail_at_) {
      std::copy_n(tail_.begin() + static_cast<std::ptrdiff_t>(offset - tail_at_), bytes, out.begin());
    } else {
      file_.read(offset, out);
    }
    return out;
  }

 private:
  const InputFile& file_;
  std::vector<std::byte> tail_;
  std::uint64_t tail_at_;
};

MapHeader parse_header(const InputFile& file, const Footer& footer, Bytes bytes) {
  return located(file, footer.header_offset, "", [&] {
    const Block block = parse_block(bytes, Kind::kMapHeader);
    if (block.header.payload_hash != footer.header_hash) {
      fail("the map header is not the one the footer names");
    }
    return read_map_header(bytes);
  });
}

Root parse_root(const InputFile& file, const Footer& footer, Bytes bytes, std::size_t types) {
  return located(file, footer.root_offset, "", [&] {
    const Block block = parse_block(bytes, Kind::kIndexRoot);
    if (block.header.payload_hash != footer.root_hash) fail("the index root is not the one the footer names");
    return read_root(bytes, footer.root_offset, types);
  });
}

/// Footer, root and pages say the same of the map's extent.
void check_totals(const InputFile& file, const Footer& footer, const Root& root) {
  std::uint64_t layers = 0;
  PatchRange range;
  for (const fbs::PageRef& ref : root.pages) {
    layers += ref.entries();
    range.add(PatchRange{{ref.x_min(), ref.y_min()}, {ref.x_max(), ref.y_max()}});
  }
  const PatchRange said{{footer.x_min, footer.y_min}, {footer.x_max, footer.y_max}};
  if (layers == footer.layers && range == said && (footer.patches == 0) == (layers == 0)) return;
  fail_damaged(file, footer.root_offset, "the index does not hold what the footer says");
}

}  // namespace

std::string to_text(const Tags& tags) {
  std::string text;
  for (const auto& [name, number] : tags) {
    text += (text.empty() ? "" : " ") + name + "=" + std::to_string(number);
  }
  return text;
}

Tags parse_tags(const std::string& text) {
  if (text.empty()) fail("the list of tags is empty");
  Tags tags;
  for (std::string_view rest = text; !rest.empty();) {
    const std::string_view pair = rest.substr(0, rest.find(' '));
    rest.remove_prefix(std::min(rest.size(), pair.size() + 1));
    const std::size_t equals = pair.find('=');
    if (equals == std::string_view::npos) fail("the list of tags is malformed");
    const std::string name(pair.substr(0, equals));
    std::uint64_t number = 0;
    const auto [end, error] = std::from_chars(pair.data() + equals + 1, pair.data() + pair.size(), number);
    if (error != std::errc{} || end != pair.data() + pair.size() || number == 0 || !is_tag_name(name)) {
      fail("the list of tags is malformed");
    }
    tags.emplace(name, number);
  }
  if (to_text(tags) != text) fail("the list of tags is malformed");  // one way to write a list
  return tags;
}

Tags tags_of(const MapHeader& header) {
  const auto found = header.metadata.find(kTagsKey);
  return found == header.metadata.end() ? Tags() : parse_tags(found->second);
}

void strip_archive_keys(MapHeader& header) {
  std::erase_if(header.metadata, [](const auto& pair) { return pair.first.starts_with(kArchiveKeys); });
}

OpenCommit open_commit(const InputFile& file, const FooterAt& at) {
  const Footer& f = at.footer;
  const BlocksBefore blocks(file, at.end());
  OpenCommit commit{at, parse_header(file, f, blocks.read(f.header_offset, f.header_bytes)), {}};
  commit.root = parse_root(file, f, blocks.read(f.root_offset, f.root_bytes), commit.header.types.size());
  check_totals(file, f, commit.root);
  return commit;
}

MapHeader header_of(const InputFile& file, const FooterAt& at) {
  std::vector<std::byte> bytes(at.footer.header_bytes);
  file.read(at.footer.header_offset, bytes);
  return parse_header(file, at.footer, bytes);
}

FooterAt find_commit(const InputFile& file, const FooterAt& last, std::uint64_t number) {
  if (number == 0) return last;
  FooterAt at = last;
  while (at.footer.commits > number && at.footer.previous_footer != 0) at = previous_footer(file, at);
  if (at.footer.commits == number) return at;
  throw Error(ErrorCode::kInvalidArgument, "'" + file.path() + "' has no commit " + std::to_string(number))
      .hint("the last is " + std::to_string(last.footer.commits) + "; 'apgm-archive log' lists them")
      .at(file.path());
}

std::vector<FooterAt> last_of_each(const std::vector<FooterAt>& chain) {
  std::vector<FooterAt> commits;
  for (const FooterAt& at : chain) {
    if (commits.empty() || commits.back().footer.commits != at.footer.commits) commits.push_back(at);
  }
  std::reverse(commits.begin(), commits.end());
  return commits;
}

std::vector<CommitInfo> log_of(const InputFile& file, const FooterAt& last) {
  std::vector<CommitInfo> log;
  std::uint64_t end = 0;
  Tags tags;
  MapHeader header;
  std::optional<Footer> before;  // hostile files name one large header in each of many footers
  for (const FooterAt& at : last_of_each(footer_chain(file, last))) {
    const Footer& f = at.footer;
    if (!before || before->header_offset != f.header_offset || before->header_bytes != f.header_bytes ||
        before->header_hash != f.header_hash) {
      header = header_of(file, at);
    }
    before = f;
    CommitInfo info;
    info.number = at.footer.commits;
    info.content_id = to_hex(at.footer.content_id);
    info.stamp_ns = header.stamp_ns;
    info.patches = at.footer.patches;
    info.layers = at.footer.layers;
    info.added_bytes = at.end() - end;
    if (const auto text = header.metadata.find(kMessageKey); text != header.metadata.end()) {
      info.message = text->second;
    }
    end = at.end();
    if (at.offset == last.offset) {
      tags = located(file, at.footer.header_offset, "", [&] { return tags_of(header); });
    }
    log.push_back(std::move(info));
  }
  for (const auto& [name, number] : tags) {
    const auto named = std::ranges::lower_bound(log, number, {}, &CommitInfo::number);
    if (named == log.end() || named->number != number) {
      fail_damaged(file, last.footer.header_offset, "tag '" + name + "' names a commit that does not exist");
    }
    named->tags.push_back(name);
  }
  return log;
}

}  // namespace apgm::format
