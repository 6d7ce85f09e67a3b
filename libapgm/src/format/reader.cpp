#include "apgm/format/reader.hpp"

#include <algorithm>
#include <cstring>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm_generated.h"
#include "codec.hpp"
#include "content_id.hpp"
#include "index.hpp"
#include "input_file.hpp"
#include "map_header.hpp"

namespace apgm {

using namespace format;

namespace {

/// What is read at once from the end of a file: the footer, and for most maps the index root before it.
constexpr std::uint64_t kTailBytes = 64 * 1024;
/// FlatBuffer of a layer: a table of a few numbers, with room for fields of later versions.
constexpr std::size_t kMaxLayerMeta = 4096;

std::string hex(std::span<const std::byte> bytes) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const std::byte b : bytes) {
    if (!text.empty()) text += ' ';
    text += kDigits[static_cast<unsigned>(b) >> 4];
    text += kDigits[static_cast<unsigned>(b) & 15];
  }
  return text;
}

/// Names what a file looks like from its first bytes; nullptr if nothing is recognised.
const char* guess_format(std::span<const std::byte> head) {
  const std::string_view text(reinterpret_cast<const char*>(head.data()), head.size());
  struct Mark {
    std::string_view start;
    const char* name;
  };
  static constexpr Mark kMarks[] = {
      {"\x89PNG", "PNG image"},
      {"# Octomap OcTree", "OctoMap tree"},
      {"P2", "PGM image"},
      {"P5", "PGM image"},
      {"II*", "TIFF image"},
      {"MM", "TIFF image"},
      {"image:", "map_server YAML"},
      {"\x1f\x8b", "gzip archive"},
      {"PK\x03\x04", "zip archive"},
      {"\x28\xb5\x2f\xfd", "zstd archive"},
      {"BZh", "bzip2 archive"},
      {"\xff\xd8\xff", "JPEG image"},
      {"{", "JSON text"},
  };
  for (const Mark& mark : kMarks) {
    if (text.substr(0, mark.start.size()) == mark.start) return mark.name;
  }
  return nullptr;
}

[[noreturn]] void fail_foreign(const InputFile& file, std::span<const std::byte> head) {
  const char* guess = guess_format(head);
  std::string text = "'" + file.path() + "' is not an apgm file: ";
  if (head.empty()) {
    text += "it is empty";
  } else {
    text += "starts with " + hex(head.first(std::min<std::size_t>(4, head.size())));
    if (guess != nullptr) text += " (" + std::string(guess) + ")";
  }
  throw Error(ErrorCode::kForeign, text).at(file.path(), 0);
}

constexpr const char* kCopyAgain = "get the file again from where it came; a copy may have been cut short";
constexpr const char* kSalvage = "'apgm crop --salvage' keeps the layers that are whole";

[[noreturn]] void fail_damaged(const InputFile& file, std::uint64_t offset, const std::string& what,
                               const char* hint = kCopyAgain) {
  throw Error(ErrorCode::kDamaged,
              "'" + file.path() + "' is damaged: " + what + " at byte " + std::to_string(offset))
      .hint(hint)
      .at(file.path(), offset);
}

/// Runs `work`; what it finds wrong gets the file's name and the byte.
template <typename Work>
auto located(const InputFile& file, std::uint64_t offset, const std::string& where, Work work,
             const char* hint = kCopyAgain) {
  try {
    return work();
  } catch (const Error& e) {
    if (!e.path().empty()) throw;
    const std::string text = where.empty() ? e.message() : where + ": " + e.message();
    if (e.code() == ErrorCode::kDamaged) fail_damaged(file, offset, text, hint);
    throw Error(e.code(), "'" + file.path() + "': " + text).hint(e.hint()).at(file.path(), offset);
  }
}

std::string name_of(PatchIndex patch, const std::string& layer) {
  return "patch (" + std::to_string(patch.x) + "," + std::to_string(patch.y) + ") layer '" + layer + "'";
}

Footer parse_footer(Bytes bytes, std::uint64_t file_bytes) {
  const Block block = parse_block(bytes, Kind::kFooter);
  if (!block.meta.empty() || block.body.size() != sizeof(Footer))
    throw Error(ErrorCode::kDamaged, "the footer is malformed");
  const auto f = read_as<Footer>(block.body);
  const std::uint64_t end = file_bytes - kFooterBlockBytes;
  const auto inside = [&](std::uint64_t offset, std::uint64_t size) {
    return offset >= sizeof(Preamble) && offset % 8 == 0 && offset <= end && size <= end - offset;
  };
  if (f.tail != kTail || f.file_bytes != file_bytes || f.commits < 1 || f.patches > f.layers ||
      std::any_of(f.reserved.begin(), f.reserved.end(), [](auto v) { return v != 0; }) ||
      !inside(f.header_offset, f.header_bytes) || f.header_bytes > kMaxHeaderBytes + 4096 ||
      !inside(f.root_offset, f.root_bytes) || f.root_bytes > kMaxRootBytes + 4096) {
    throw Error(ErrorCode::kDamaged, "the footer does not fit the file");
  }
  return f;
}

}  // namespace

struct Reader::State {
  explicit State(const std::string& path) : file(path) {}
  State(Bytes bytes, const std::string& name) : file(bytes, name) {}

  InputFile file;
  MapHeader header;
  Footer footer;
  Root root;
  FileInfo info;
  std::vector<std::byte> tail;  // while opening
  std::uint64_t tail_at = 0;

  void open() {
    check_preamble();
    read_tail();
    const auto bytes = block_bytes(footer.header_offset, footer.header_bytes);
    header = located(file, footer.header_offset, "", [&] {
      const Block block = parse_block(bytes, Kind::kMapHeader);
      if (block.header.payload_hash != footer.header_hash)
        throw Error(ErrorCode::kDamaged, "the map header is not the one the footer names");
      return read_map_header(bytes);
    });
    const auto root_block = block_bytes(footer.root_offset, footer.root_bytes);
    root = located(file, footer.root_offset, "", [&] {
      const Block block = parse_block(root_block, Kind::kIndexRoot);
      if (block.header.payload_hash != footer.root_hash)
        throw Error(ErrorCode::kDamaged, "the index root is not the one the footer names");
      return read_root(root_block, footer.root_offset, header.types.size());
    });
    tail = {};
    check_totals();
  }

  /// Footer, root and pages say the same of the map's extent.
  void check_totals() const {
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

  void check_preamble() {
    std::vector<std::byte> head(std::min<std::uint64_t>(file.size(), sizeof(Preamble)));
    file.read(0, head);
    if (head.size() < kMagic.size() || std::memcmp(head.data(), kMagic.data(), kMagic.size()) != 0) {
      fail_foreign(file, head);
    }
    if (head.size() < sizeof(Preamble)) fail_damaged(file, head.size(), "the file ends within its preamble");
    const auto p = read_as<Preamble>(head);
    if (p.hash != hash_of(Bytes(head).first(offsetof(Preamble, hash))))
      fail_damaged(file, 0, "the preamble fails its checksum");
    if (p.major != kMajor || p.incompat != 0) {
      const std::string version = std::to_string(p.major) + "." + std::to_string(p.minor);
      const std::string what = p.major != kMajor ? "is of format " + version
                                                 : "needs features this version does not know (bits " +
                                                       std::to_string(p.incompat) + ")";
      throw Error(ErrorCode::kUnsupported, "'" + file.path() + "' " + what)
          .hint("this program reads format " + std::to_string(kMajor) +
                ".x; a newer version of apgm can read it")
          .at(file.path(), 8);
    }
    info.file_bytes = file.size();
    info.version_major = p.major;
    info.version_minor = p.minor;
  }

  void read_tail() {
    if (file.size() < sizeof(Preamble) + kFooterBlockBytes) {
      fail_damaged(file, file.size(), "the file is cut short, its index is missing");
    }
    tail.resize(std::min(kTailBytes, file.size()));
    tail_at = file.size() - tail.size();
    file.read(tail_at, tail);
    footer =
        located(file, file.size() - kFooterBlockBytes, "the file's end is not a footer, it may be cut short",
                [&] { return parse_footer(Bytes(tail).last(kFooterBlockBytes), file.size()); });
    info.commits = footer.commits;
  }

  std::vector<std::byte> block_bytes(std::uint64_t offset, std::uint64_t bytes) const {
    std::vector<std::byte> out(bytes);
    if (offset >= tail_at && !tail.empty()) {
      std::memcpy(out.data(), tail.data() + (offset - tail_at), bytes);
    } else {
      file.read(offset, out);
    }
    return out;
  }
};

namespace {

class FileCursor final : public PatchCursor {
 public:
  FileCursor(const InputFile& file, const TypeTable& types, const Root& root, std::uint64_t end,
             std::optional<PatchRange> range)
      : file_(file), types_(types), root_(root), end_(end), range_(range) {}

  bool next(PatchInfo& out) override {
    out.layers.clear();
    for (;;) {
      if (at_ == entries_.size() && !next_page()) return !out.layers.empty();
      const IndexEntry& e = entries_[at_];
      const PatchIndex patch{e.ix, e.iy};
      if (!out.layers.empty() && patch != out.patch) return true;
      ++at_;
      if (range_ && !range_->contains(patch)) continue;
      out.patch = patch;
      out.layers.push_back(
          {patch, e.type, e.step, e.encoding, e.stored_bytes, e.content_hash, e.stamp_ns, e.offset});
    }
  }

 private:
  bool next_page() {
    while (page_ < root_.pages.size()) {
      const fbs::PageRef& ref = root_.pages[page_++];
      const PatchRange covers{{ref.x_min(), ref.y_min()}, {ref.x_max(), ref.y_max()}};
      if (range_ && !range_->meets(covers)) continue;
      buffer_.resize(ref.bytes());
      file_.read(ref.offset(), buffer_);
      located(file_, ref.offset(), "", [&] { take_page(ref); });
      at_ = 0;
      return true;
    }
    return false;
  }

  void take_page(const fbs::PageRef& ref) {
    const bool first = entries_.empty();
    const auto last = first ? std::pair<std::uint64_t, std::uint16_t>{} : order(entries_.back());
    read_page(buffer_, ref, end_, types_, root_, entries_);
    if (!first && order(entries_.front()) <= last)
      throw Error(ErrorCode::kDamaged, "index entries are not in order");
  }

  static std::pair<std::uint64_t, std::uint16_t> order(const IndexEntry& e) { return {e.key, e.type}; }

  const InputFile& file_;
  const TypeTable& types_;
  const Root& root_;
  std::uint64_t end_;
  std::optional<PatchRange> range_;
  std::size_t page_ = 0;
  std::size_t at_ = 0;
  std::vector<IndexEntry> entries_;
  std::vector<std::byte> buffer_;
};

/// The stored block of a layer, checked against what the index says of it. The result points into `buffer`.
Block read_layer(const InputFile& file, const LayerInfo& info, std::vector<std::byte>& buffer) {
  buffer.resize(info.stored_bytes);
  file.read(info.locator, buffer);
  const Block block = parse_block(buffer, Kind::kLayer);
  if (block.meta.size() > kMaxLayerMeta) throw Error(ErrorCode::kDamaged, "the block is malformed");
  flatbuffers::Verifier verifier(reinterpret_cast<const std::uint8_t*>(block.meta.data()), block.meta.size(),
                                 8, 64);
  if (!verifier.VerifyBuffer<fbs::Layer>(nullptr)) throw Error(ErrorCode::kDamaged, "the block is malformed");
  const auto& l = *flatbuffers::GetRoot<fbs::Layer>(block.meta.data());
  if (block.header.key != curve_key(info.patch) || l.ix() != info.patch.x || l.iy() != info.patch.y ||
      l.type() != info.type || l.step() != info.step || l.encoding() != info.encoding ||
      l.content_hash() != info.content_hash || l.stamp_ns() != info.stamp_ns) {
    throw Error(ErrorCode::kDamaged, "the block is not the one the index names");
  }
  if (!(l.error_bound() >= 0 && l.error_bound() <= 1))
    throw Error(ErrorCode::kDamaged, "the error bound is no mass");
  return block;
}

std::vector<std::byte>& layer_buffer() {
  thread_local std::vector<std::byte> buffer;
  return buffer;
}

}  // namespace

Reader::Reader(const std::string& path) : state_(std::make_unique<State>(path)) { state_->open(); }
Reader::Reader(std::span<const std::byte> bytes, const std::string& name)
    : state_(std::make_unique<State>(bytes, name)) {
  state_->open();
}
Reader::~Reader() = default;

const MapHeader& Reader::header() const { return state_->header; }
const FileInfo& Reader::file() const { return state_->info; }
const std::string& Reader::path() const { return state_->file.path(); }
std::string Reader::content_id() const { return to_hex(state_->footer.content_id); }

Summary Reader::summary() const {
  const Footer& f = state_->footer;
  Summary s;
  s.patches = f.patches;
  s.range = {{f.x_min, f.y_min}, {f.x_max, f.y_max}};
  s.types = state_->root.totals;
  return s;
}

std::unique_ptr<PatchCursor> Reader::patches(const std::optional<PatchRange>& range) const {
  return std::make_unique<FileCursor>(state_->file, state_->header.types, state_->root,
                                      state_->footer.root_offset, range);
}

void Reader::load(const LayerInfo& info, Layer& out) const {
  const LayerType& type = state_->header.types[info.type];
  located(
      state_->file, info.locator, name_of(info.patch, type.name),
      [&] {
        const Block block = read_layer(state_->file, info, layer_buffer());
        decode(static_cast<Encoding>(info.encoding), info.step, block.body, type, out);
        if (content_hash(out) != info.content_hash) {
          throw Error(ErrorCode::kDamaged, "the cells are not those of the content hash");
        }
        if (is_vacuous(out, type)) throw Error(ErrorCode::kDamaged, "the layer holds no data");
        out.stamp_ns = info.stamp_ns;
        out.error_bound = flatbuffers::GetRoot<fbs::Layer>(block.meta.data())->error_bound();
      },
      kSalvage);
}

bool Reader::load_stored(const LayerInfo& info, StoredLayer& out) const {
  const LayerType& type = state_->header.types[info.type];
  return located(
      state_->file, info.locator, name_of(info.patch, type.name),
      [&] {
        const Block block = read_layer(state_->file, info, layer_buffer());
        out.encoding = info.encoding;
        out.step = info.step;
        out.content_hash = info.content_hash;
        out.error_bound = flatbuffers::GetRoot<fbs::Layer>(block.meta.data())->error_bound();
        out.bytes.assign(block.body.begin(), block.body.end());
        return true;
      },
      kSalvage);
}

}  // namespace apgm
