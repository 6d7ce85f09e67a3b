#include "converters/octomap/octree_file.hpp"

#include <octomap/OcTree.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <ostream>
#include <span>
#include <streambuf>

#include "apgm/core/error.hpp"
#include "converters/common/file.hpp"
#include "converters/common/settings.hpp"

namespace apgm::converters {
namespace {

constexpr std::string_view kBinaryLine = "# Octomap OcTree binary file";
constexpr std::string_view kFullLine = "# Octomap OcTree file";

[[noreturn]] void damaged(const std::string& what, std::size_t offset) {
  throw Error(ErrorCode::kDamaged, what + " at byte " + std::to_string(offset)).at("", offset);
}

/// Splits the header into words as OctoMap does: a comment, an unknown key and `data` end with their line.
class HeaderWords {
 public:
  explicit HeaderWords(std::string_view bytes) : bytes_(bytes) {}

  std::optional<std::string_view> next() {
    while (at_ < bytes_.size() && is_space(bytes_[at_])) ++at_;
    const std::size_t start = at_;
    while (at_ < bytes_.size() && !is_space(bytes_[at_])) ++at_;
    if (at_ == start) return {};
    return bytes_.substr(start, at_ - start);
  }
  std::string_view value_of(std::string_view key) {
    const auto word = next();
    if (!word || at_ == bytes_.size())
      damaged("the octree header ends after '" + std::string(key) + "'", at_);
    return *word;
  }
  void skip_line() {
    const std::size_t end = bytes_.find('\n', at_);
    at_ = end == std::string_view::npos ? bytes_.size() : end + 1;
  }
  std::size_t at() const { return at_; }

 private:
  static bool is_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

  std::string_view bytes_;
  std::size_t at_ = 0;
};

void check_id(std::string_view id) {
  if (id == "OcTree") return;
  throw Error(ErrorCode::kUnsupported, "the octree is of type '" + printable(id) + "'")
      .hint("only OcTree is read; OctoMap can save other trees as .bt, which keeps free and occupied");
}

double parse_resolution(std::string_view word, std::size_t at) {
  const auto value = parse_number(word);
  if (!value || !(*value >= 1e-5 && *value <= 1e4)) {
    damaged("the octree's resolution is not a number of metres in 0.00001..10000", at);
  }
  return *value;
}

std::uint64_t parse_count(std::string_view word, std::size_t at) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size())
    damaged("the octree's size is not a count", at);
  return value;
}

/// The way down to a node, with the children still to be visited on each level.
class Pending {
 public:
  int depth() const { return depth_; }
  /// Enters a node whose `children` (a bit each) come next in the file.
  void enter(unsigned children) { children_[static_cast<std::size_t>(++depth_)] = children; }
  /// Leaves the nodes that are done and takes the next child; false at the end.
  bool advance() {
    while (depth_ >= 0 && children_[static_cast<std::size_t>(depth_)] == 0) --depth_;
    if (depth_ < 0) return false;
    unsigned& children = children_[static_cast<std::size_t>(depth_)];
    children &= children - 1;
    return true;
  }

 private:
  std::array<unsigned, kTreeDepth + 1> children_{};
  int depth_ = -1;
};

struct NodeCount {
  std::uint64_t nodes = 0;
  std::uint64_t inner = 0;
};

/// .bt: two bytes for each inner node, two bits for each child, the inner children following in order.
NodeCount walk_binary(std::string_view bytes, std::size_t at) {
  Pending pending;
  NodeCount count{1, 0};
  do {
    if (bytes.size() - at < 2) damaged("the octree is cut off", bytes.size());
    const unsigned bits = static_cast<unsigned char>(bytes[at]) | static_cast<unsigned char>(bytes[at + 1])
                                                                      << 8;
    unsigned inner = 0;
    unsigned children = 0;
    for (unsigned child = 0; child < 8; ++child) {
      const unsigned kind = bits >> (2 * child) & 3u;
      children += kind != 0;
      if (kind == 3) inner |= 1u << child;
    }
    if (children == 0) damaged("an inner node of the octree has no children", at);
    if (inner != 0 && pending.depth() + 2 >= kTreeDepth) damaged("the octree is deeper than 16 levels", at);
    count.nodes += children;
    ++count.inner;
    at += 2;
    pending.enter(inner);
  } while (pending.advance());
  if (at != bytes.size()) damaged("data follow the octree's last node", at);
  return count;
}

/// .ot: float32 and a byte that marks the children for each node, the children following in order.
NodeCount walk_full(std::string_view bytes, std::size_t at) {
  constexpr std::size_t kNodeBytes = 5;
  Pending pending;
  NodeCount count;
  do {
    if (bytes.size() - at < kNodeBytes) damaged("the octree is cut off", bytes.size());
    float log_odds = 0;
    std::memcpy(&log_odds, bytes.data() + at, sizeof log_odds);
    if (std::isnan(log_odds)) damaged("a node of the octree is not a number", at);
    ++count.nodes;
    const auto children = static_cast<std::uint8_t>(bytes[at + 4]);
    if (children != 0 && pending.depth() + 1 >= kTreeDepth)
      damaged("the octree is deeper than 16 levels", at);
    count.inner += children != 0;
    at += kNodeBytes;
    pending.enter(children);
  } while (pending.advance());
  if (at != bytes.size()) damaged("data follow the octree's last node", at);
  return count;
}

/// Reads from memory without a copy.
class MemoryBuffer final : public std::streambuf {
 public:
  explicit MemoryBuffer(std::string& bytes, std::size_t from) {
    setg(bytes.data(), bytes.data() + from, bytes.data() + bytes.size());
  }
};

/// Writes to a file without a copy of the whole.
class FileBuffer final : public std::streambuf {
 public:
  explicit FileBuffer(OutputFile& file) : file_(file) {}

 protected:
  int_type overflow(int_type c) override {
    if (c == traits_type::eof()) return 0;
    const char one = traits_type::to_char_type(c);
    xsputn(&one, 1);
    return c;
  }
  std::streamsize xsputn(const char* text, std::streamsize size) override {
    file_.write(std::as_bytes(std::span(text, static_cast<std::size_t>(size))));
    return size;
  }

 private:
  OutputFile& file_;
};

}  // namespace

bool is_octree(std::string_view head) { return head.starts_with(kBinaryLine) || head.starts_with(kFullLine); }

OctreeHeader parse_octree_header(std::string_view bytes) {
  if (!is_octree(bytes)) {
    throw Error(ErrorCode::kForeign, "not an octree: the first line is not '" + std::string(kFullLine) + "'");
  }
  OctreeHeader header;
  header.binary = bytes.starts_with(kBinaryLine);
  bool has_id = false, has_nodes = false, has_resolution = false;
  HeaderWords words(bytes);
  while (const auto word = words.next()) {
    if (*word == "data") {
      words.skip_line();
      if (!has_id || !has_nodes || !has_resolution) {
        damaged("the octree header lacks its id, size or res", words.at());
      }
      header.data_at = words.at();
      return header;
    }
    if (*word == "id") {
      check_id(words.value_of(*word));
      has_id = true;
    } else if (*word == "size") {
      header.nodes = parse_count(words.value_of(*word), words.at());
      has_nodes = true;
    } else if (*word == "res") {
      header.resolution_m = parse_resolution(words.value_of(*word), words.at());
      has_resolution = true;
    } else {
      words.skip_line();
    }
  }
  damaged("the octree header has no data line", bytes.size());
}

std::uint64_t octree_memory(std::uint64_t nodes, std::uint64_t inner) {
  // A node of a list and a float, and the list of the children, as malloc rounds them.
  constexpr std::uint64_t kNodeBytes = 32, kChildrenBytes = 80;
  return nodes * kNodeBytes + inner * kChildrenBytes;
}

std::uint64_t check_octree_nodes(std::string_view bytes, const OctreeHeader& header) {
  const bool empty = header.nodes == 0 && bytes.size() == header.data_at;
  const NodeCount count = empty           ? NodeCount{}
                          : header.binary ? walk_binary(bytes, header.data_at)
                                          : walk_full(bytes, header.data_at);
  if (count.nodes != header.nodes) {
    damaged("the octree has " + std::to_string(count.nodes) + " nodes, its header says " +
                std::to_string(header.nodes),
            header.data_at);
  }
  return octree_memory(count.nodes, count.inner);
}

std::unique_ptr<::octomap::OcTree> read_octree(const std::string& path, std::uint64_t max_memory_bytes) {
  std::string bytes = read_file_within(path, max_memory_bytes);
  try {
    const OctreeHeader header = parse_octree_header(bytes);
    const std::uint64_t tree_bytes = check_octree_nodes(bytes, header);
    check_budget(max_memory_bytes, bytes.size() + tree_bytes, "an octree is held in memory as a whole",
                 "prune the octree");
    auto tree = std::make_unique<::octomap::OcTree>(header.resolution_m);
    if (header.nodes == 0) return tree;
    MemoryBuffer buffer(bytes, header.data_at);
    std::istream stream(&buffer);
    if (header.binary) {
      tree->readBinaryData(stream);
    } else {
      tree->readData(stream);
    }
    return tree;
  } catch (Error& error) {
    throw Error(error.code(), "'" + path + "': " + error.message())
        .hint(error.hint())
        .at(path, error.offset_bytes());
  }
}

void write_octree(const ::octomap::OcTree& tree, bool binary, OutputFile& file) {
  FileBuffer buffer(file);
  std::ostream out(&buffer);
  out.exceptions(std::ios::badbit);  // what the file throws goes on its way
  out << (binary ? kBinaryLine : kFullLine)
      << "\n# (feel free to add / change comments, but leave the first line as it is!)\n#\nid OcTree\nsize "
      << std::to_string(tree.size()) << "\nres " << format_number(tree.getResolution()) << "\ndata\n";
  if (binary) {
    tree.writeBinaryData(out);
  } else {
    tree.writeData(out);
  }
}

}  // namespace apgm::converters
