#include "apgm/format/reader.hpp"

#include <algorithm>
#include <vector>

#include "apgm/core/error.hpp"
#include "commits.hpp"
#include "content_id.hpp"
#include "file_cursor.hpp"
#include "footer.hpp"
#include "located.hpp"
#include "preamble.hpp"

namespace apgm {

using namespace format;

namespace {

/// Opening meets an append that is being taken back at most a few times in a row.
constexpr int kAttempts = 8;

}  // namespace

struct Reader::State {
  explicit State(std::unique_ptr<const InputFile> input) : file(std::move(input)) {}

  std::unique_ptr<const InputFile> file;
  FileInfo info;
  FooterAt last;
  OpenCommit commit;

  void open(const ReaderOptions& options) {
    const Preamble preamble = read_preamble(*file);
    info.archive = is_archive(preamble);
    const Tail tail = find_last_footer(*file, info.archive);
    last = tail.last;
    commit = open_commit(*file, find_commit(*file, last, options.commit));
    info.file_bytes = file->size();
    info.version_major = preamble.major;
    info.version_minor = preamble.minor;
    info.commits = commit.at.footer.commits;
    info.uncommitted_bytes = tail.uncommitted_bytes;
    if (info.archive) strip_archive_keys(commit.header);
  }
};

Reader::Reader(const std::string& path, const ReaderOptions& options) {
  for (int attempt = 1;; ++attempt) {
    state_ = std::make_unique<State>(std::make_unique<InputFile>(path));
    try {
      state_->open(options);
      return;
    } catch (const Error& e) {
      // Who appends cuts a torn end off: then the file is looked at again.
      const bool shrank = e.code() == ErrorCode::kDamaged && state_->file->has_shrunk();
      if (!shrank || attempt == kAttempts) throw;
    }
  }
}

Reader::Reader(std::span<const std::byte> bytes, const std::string& name, const ReaderOptions& options)
    : state_(std::make_unique<State>(std::make_unique<InputFile>(bytes, name))) {
  state_->open(options);
}

Reader::~Reader() = default;

const MapHeader& Reader::header() const { return state_->commit.header; }
const FileInfo& Reader::file() const { return state_->info; }
const std::string& Reader::path() const { return state_->file->path(); }
std::string Reader::content_id() const { return to_hex(state_->commit.at.footer.content_id); }

std::vector<CommitInfo> Reader::commits() const {
  FooterAt last = state_->last;
  if (!state_->info.archive) last.footer.previous_footer = 0;
  return log_of(*state_->file, last);
}

Summary Reader::summary() const {
  const Footer& f = state_->commit.at.footer;
  Summary s;
  s.patches = f.patches;
  s.range = {{f.x_min, f.y_min}, {f.x_max, f.y_max}};
  s.types = state_->commit.root.totals;
  return s;
}

std::unique_ptr<PatchCursor> Reader::patches(const std::optional<PatchRange>& range) const {
  const OpenCommit& c = state_->commit;
  return std::make_unique<FileCursor>(*state_->file, c.header.types, c.root, c.at.footer.root_offset, range);
}

void Reader::load(const LayerInfo& info, Layer& out) const {
  const LayerType& type = header().types[info.type];
  located(
      *state_->file, info.locator, name_of(info.patch, type.name),
      [&] {
        const LoadedLayer loaded = read_layer(*state_->file, info, layer_buffer());
        decode_layer(loaded.layer, loaded.body, type, out);
      },
      kSalvage);
}

bool Reader::load_stored(const LayerInfo& info, StoredLayer& out) const {
  const LayerType& type = header().types[info.type];
  return located(
      *state_->file, info.locator, name_of(info.patch, type.name),
      [&] {
        read_stored(*state_->file, info, out);
        return true;
      },
      kSalvage);
}

}  // namespace apgm
