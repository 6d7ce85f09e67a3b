#include "archive_target.hpp"

#include <filesystem>
#include <system_error>

#include "apgm/core/error.hpp"
#include "map_header.hpp"
#include "preamble.hpp"
#include "scan.hpp"

namespace apgm::format {

Preamble check_is_archive(const InputFile& file) {
  if (file.size() == 0) {
    throw Error(ErrorCode::kForeign, "'" + file.path() + "' is not an archive: it is empty")
        .hint("remove it: 'apgm-archive commit' makes an archive where there is no file")
        .at(file.path(), 0);
  }
  const Preamble preamble = read_preamble(file);
  if (is_archive(preamble)) return preamble;
  throw Error(ErrorCode::kIncompatible, "'" + file.path() + "' is a sealed map, not an archive")
      .hint("commit it to a new archive: apgm-archive commit NEW.apgm " + file.path())
      .at(file.path());
}

namespace {

void check_may_append(const InputFile& file) {
  const Preamble preamble = check_is_archive(file);
  if (preamble.ro_compat != 0) {
    throw Error(ErrorCode::kUnsupported, "'" + file.path() + "' can be read, but not appended to (bits " +
                                             std::to_string(preamble.ro_compat) + ")")
        .hint("a newer version of apgm can append to it")
        .at(file.path(), 16);
  }
}

}  // namespace

TornEnd torn_end(const InputFile& file, const Tail& tail) {
  TornEnd torn{tail.uncommitted_bytes, 0};
  if (torn.bytes == 0) return torn;
  BlockScan scan(file, tail.last.end(), file.size());
  for (Spot spot; scan.next(spot);) {
    if (spot.state == Spot::State::kWhole && spot.header.kind == Kind::kLayer) ++torn.layers;
  }
  return torn;
}

AppendTarget::AppendTarget(AppendFile& file, const std::string& path) : file_(file) {
  input_.emplace(file, file.size(), path);
  check_may_append(*input_);
  const Tail tail = find_last_footer(*input_, true);
  base_ = open_commit(*input_, tail.last);
  torn_ = torn_end(*input_, tail);
}

/// Before anything is written.
void AppendTarget::make_ready() {
  const FooterAt& last = base_->at;
  if (torn_.bytes != 0) file_.cut(last.end());
  // The writer of the last footer may not have lived to see it reach the disk, and a sync that failed may
  // have left it in memory alone, where the next sync passes over it: unless it is written once more. All
  // before it was on the disk before it was written.
  std::vector<std::byte> footer(kFooterBlockBytes);
  file_.read(last.offset, footer);
  file_.rewrite(last.offset, footer);
  // Also where another just cut the file: on the disk before anything new is written there, else a crash
  // could leave parts of both, and a footer of the one over blocks of the other.
  file_.sync();
  ready_ = true;
}

AppendTarget::~AppendTarget() {
  if (!dirty_) return;
  try {
    file_.cut(base_->at.end());
    file_.sync();
  } catch (...) {
    // It is then a torn end, which readers pass over and the next commit cuts off.
  }
}

void AppendTarget::write(Bytes bytes) {
  if (!ready_) make_ready();
  dirty_ = true;
  file_.write(bytes);
}

void AppendTarget::close(Bytes footer) {
  file_.sync();
  file_.write(footer);
  file_.sync();
  dirty_ = false;
}

void write_tags(AppendTarget& target, const Tags& tags) {
  const OpenCommit& base = *target.base();
  MapHeader header = base.header;
  header.metadata.erase(kTagsKey);
  if (!tags.empty()) header.metadata[kTagsKey] = to_text(tags);
  Footer footer = base.at.footer;
  std::vector<std::byte> block;
  footer.header_hash = append_map_header(block, header, footer.commits).payload_hash;
  footer.header_offset = target.size();
  footer.header_bytes = block.size();
  target.write(block);
  footer.previous_footer = base.at.offset;
  footer.file_bytes = target.size() + kFooterBlockBytes;
  target.close(footer_block(footer));
}

TrialTarget::TrialTarget() : size_(sizeof(Preamble)) {}

TrialTarget::TrialTarget(const std::string& path) {
  check_may_write(path);
  input_.emplace(path);
  check_may_append(*input_);
  const Tail tail = find_last_footer(*input_, true);
  base_ = open_commit(*input_, tail.last);
  torn_ = torn_end(*input_, tail);
  size_ = base_->at.end();
}

namespace {

/// Runs `work` on a file that was not there before: if it is there when that fails, another made it.
template <typename Work>
auto making(const std::string& path, Work work) {
  try {
    return work();
  } catch (const Error& e) {
    std::error_code error;
    if (e.code() == ErrorCode::kOutput && !path.empty() && std::filesystem::exists(path, error)) {
      throw another_writes(path);
    }
    throw;
  }
}

}  // namespace

CreateTarget::CreateTarget(OutputFile file) {
  blocks_.file.emplace(std::move(file));
  blocks_.write(bytes_of(make_preamble(true)));
}

CreateTarget::CreateTarget(const std::string& path)
    : CreateTarget(making(path, [&] { return OutputFile(path, {.overwrite = false, .fsync = true}); })) {
  path_ = path;
}

void CreateTarget::close(Bytes footer) {
  blocks_.write(footer);
  making(path_, [&] { blocks_.file->commit(); });
}

}  // namespace apgm::format
