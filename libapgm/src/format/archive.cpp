#include "apgm/format/archive.hpp"

#include <cassert>
#include <filesystem>

#include "apgm/core/error.hpp"
#include "archive_merge.hpp"
#include "archive_target.hpp"
#include "commits.hpp"
#include "content_id.hpp"
#include "layer_block.hpp"
#include "located.hpp"
#include "map_header.hpp"

namespace apgm {

using namespace format;

namespace {

bool is_there(const std::string& path) {
  std::error_code error;
  return std::filesystem::exists(path, error) || error;
}

void check_expected(const std::string& path, std::uint64_t expected, std::uint64_t last) {
  if (expected == last) return;
  if (last == 0) {
    throw Error(ErrorCode::kIncompatible,
                "there is no archive '" + path + "', its last commit was to be " + std::to_string(expected))
        .hint("to make a new archive expect 0, or nothing")
        .at(path);
  }
  throw Error(ErrorCode::kIncompatible, "the last commit of '" + path + "' is " + std::to_string(last) +
                                            ", not " + std::to_string(expected))
      .hint(expected < last ? "somebody committed in between; look at the archive again"
                            : "commits are missing at its end: they were torn off, or this is another file; "
                              "'apgm-verify " +
                                  path + "' tells more, 'apgm-verify --recover' saves what is left of them")
      .at(path);
}

void check_tag(const std::string& name) {
  if (may_be_given(name)) return;
  throw Error(ErrorCode::kInvalidArgument, "'" + name + "' cannot be a tag")
      .hint(is_tag_name(name)
                ? "it stands for a time wherever a commit is asked for"
                : "a tag starts with a letter or '_', then letters, digits and '_.+-'; at most 64 bytes");
}

Tags stored_tags(const CommitTarget& target) {
  if (target.base() == nullptr) return {};
  return located(*target.input(), target.base()->at.footer.header_offset, "",
                 [&] { return tags_of(target.base()->header); });
}

MapHeader with_archive_keys(MapHeader header, const std::string& message, const Tags& tags) {
  strip_archive_keys(header);
  if (!message.empty()) header.metadata[kMessageKey] = message;
  if (!tags.empty()) header.metadata[kTagsKey] = to_text(tags);
  return header;
}

}  // namespace

struct ArchiveWriter::State {
  ArchiveOptions options;
  std::optional<LockedFile> file;
  std::optional<Reader> last;
  std::unique_ptr<CommitTarget> target;
  TornEnd torn;
  std::optional<ArchiveMerge> merge;
  TypeTable types;
  CommitReport report;
};

ArchiveWriter::ArchiveWriter(const std::string& path, const ArchiveOptions& options) {
  check_level(options.level);
  state_ = std::make_unique<State>();
  State& s = *state_;
  s.options = options;
  if (options.create && !is_there(path)) {
    if (options.expected) check_expected(path, *options.expected, 0);
    s.target = options.dry_run ? std::unique_ptr<CommitTarget>(std::make_unique<TrialTarget>())
                               : std::make_unique<CreateTarget>(path);
    return;
  }
  const auto keep = [&s](auto target) {
    s.torn = target->torn();
    s.target = std::move(target);
  };
  if (options.dry_run) {
    keep(std::make_unique<TrialTarget>(path));
  } else {
    s.file.emplace(path);
    keep(std::make_unique<AppendTarget>(*s.file, path));
  }
  if (options.expected) check_expected(path, *options.expected, s.target->base()->at.footer.commits);
  s.last.emplace(path);
}

ArchiveWriter::~ArchiveWriter() = default;

const Reader* ArchiveWriter::last() const { return state_->last ? &*state_->last : nullptr; }

TornEnd ArchiveWriter::torn() const { return state_->torn; }

void ArchiveWriter::begin(const MapHeader& header, std::vector<MapChanges::Gone> gone,
                          const CommitOptions& options) {
  State& s = *state_;
  assert(!s.merge);
  Tags tags = stored_tags(*s.target);
  const std::uint64_t last = s.target->base() == nullptr ? 0 : s.target->base()->at.footer.commits;
  for (const std::string& name : options.tags) {
    check_tag(name);
    tags[name] = last + 1;
  }
  s.types = header.types;
  s.merge.emplace(*s.target, with_archive_keys(header, options.message, tags), std::move(gone));
}

void ArchiveWriter::pack(Parcel& parcel) const {
  pack_layer(parcel, state_->types[parcel.type], state_->options.level, Lossy::kNone);
}

std::uint64_t ArchiveWriter::working_bytes(std::uint64_t layer_bytes) const {
  return pack_memory(layer_bytes, state_->options.level);
}

void ArchiveWriter::put(PatchIndex /*index*/, std::span<Parcel> parcels) { state_->merge->put(parcels); }

void ArchiveWriter::finish() {
  State& s = *state_;
  const Footer f = s.merge->finish();
  const std::uint64_t before = s.target->base() == nullptr ? 0 : s.target->base()->at.end();
  s.report = {f.commits, to_hex(f.content_id),     f.file_bytes, f.file_bytes - before, f.patches,
              f.layers,  s.merge->layers_written()};
}

const CommitReport& ArchiveWriter::report() const { return state_->report; }

std::uint64_t tag_commit(const std::string& archive, const std::string& name, std::uint64_t number,
                         TornEnd* torn) {
  check_tag(name);
  LockedFile file(archive);
  AppendTarget target(file, archive);
  number = find_commit(*target.input(), target.base()->at, number).footer.commits;
  Tags tags = stored_tags(target);
  tags[name] = number;
  write_tags(target, tags);
  if (torn != nullptr) *torn = target.torn();
  return number;
}

void remove_tag(const std::string& archive, const std::string& name, TornEnd* torn) {
  LockedFile file(archive);
  AppendTarget target(file, archive);
  Tags tags = stored_tags(target);
  if (tags.erase(name) == 0) {
    throw Error(ErrorCode::kInvalidArgument, "'" + archive + "' has no tag '" + name + "'")
        .hint("'apgm-archive log' lists the tags")
        .at(archive);
  }
  write_tags(target, tags);
  if (torn != nullptr) *torn = target.torn();
}

}  // namespace apgm
