#include "apgm/format/verify.hpp"

#include <algorithm>

#include "located.hpp"
#include "preamble.hpp"
#include "verify_state.hpp"

namespace apgm {

using namespace format;

namespace format {
namespace {

/// A message without the file's name and the byte, which a problem has of its own.
std::string bare(const Error& error) {
  std::string text = error.message();
  const std::string head = "'" + error.path() + "' is damaged: ";
  const std::string tail = error.offset_bytes() ? " at byte " + std::to_string(*error.offset_bytes()) : "";
  if (!error.path().empty() && text.starts_with(head)) text.erase(0, head.size());
  if (!tail.empty() && text.ends_with(tail)) text.erase(text.size() - tail.size());
  return text;
}

}  // namespace

void Verification::problem(std::uint64_t offset, std::string text, std::optional<PatchIndex> patch,
                           std::string layer) {
  ++report.problem_count;
  if (report.problems.size() >= options_.max_problems) return;
  report.problems.push_back({std::move(text), offset, patch, std::move(layer)});
}

void Verification::problem(std::uint64_t offset, const std::string& where, const Error& error) {
  if (error.code() == ErrorCode::kUnsupported) {
    if (!unsupported) {
      unsupported = error.path().empty() ? located_error(file_, offset, where, error, nullptr) : error;
    }
    return;
  }
  const std::string text = bare(error);
  problem(error.offset_bytes().value_or(offset), where.empty() ? text : where + ": " + text);
}

void Verification::check_cancelled() const {
  if (options_.cancel != nullptr && options_.cancel->load(std::memory_order_relaxed)) {
    throw Error(ErrorCode::kCancelled, "cancelled");
  }
}

namespace {

/// Fills what the report says of the preamble. A damaged one is a problem, another one none of this version.
void check_preamble(const InputFile& file, Verification& v) {
  Preamble preamble;
  try {
    preamble = read_preamble(file);
  } catch (const Error& e) {
    if (e.code() != ErrorCode::kDamaged) throw;
    v.problem(0, "", e);
  }
  v.archive = is_archive(preamble);
  v.report.archive = v.archive;
  v.report.version_major = preamble.major;
  v.report.version_minor = preamble.minor;
}

/// The footers that can be reached from the end, oldest first.
std::vector<FooterAt> find_footers(const InputFile& file, Verification& v) {
  std::vector<FooterAt> footers;
  try {
    const Tail tail = find_last_footer(file, v.archive);
    v.report.uncommitted_bytes = tail.uncommitted_bytes;
    footers.push_back(tail.last);
    while (footers.back().footer.previous_footer != 0) {
      footers.push_back(previous_footer(file, footers.back()));
    }
  } catch (const Error& e) {
    if (!tells_of_file(e)) throw;
    v.problem(footers.empty() ? file.size() : footers.back().footer.previous_footer, "", e);
  }
  std::ranges::reverse(footers);
  return footers;
}

}  // namespace
}  // namespace format

namespace {

VerifyReport verify_input(const InputFile& file, const VerifyOptions& options) {
  Verification v(file, options);
  v.report.file_bytes = file.size();
  check_preamble(file, v);
  const std::uint64_t before = v.report.problem_count;
  const std::vector<FooterAt> footers = find_footers(file, v);
  const bool all = v.report.problem_count == before && !footers.empty();
  if (!footers.empty() && footers.back().footer.commits > 1 && before > 0)
    v.archive = true;  // by its preamble
  if (file.size() > sizeof(Preamble)) {
    v.walk(file.size() - v.report.uncommitted_bytes, footers.empty() ? nullptr : &footers.back());
  }
  for (std::size_t i = 0; i < footers.size(); ++i) {
    v.report.commits += i == 0 || footers[i].footer.commits != footers[i - 1].footer.commits;
  }
  if (all) v.check_chain(footers);
  for (std::size_t i = footers.size(); i-- > 0;) v.check_commit(footers[i], i + 1 == footers.size());
  v.decode_now();
  v.check_rest(all && !v.unsupported && v.report.problem_count == before);
  if (v.report.problem_count == 0 && v.unsupported) throw *v.unsupported;
  std::ranges::stable_sort(v.report.problems, {}, &Problem::offset);
  return std::move(v.report);
}

}  // namespace

VerifyReport verify(const std::string& path, const VerifyOptions& options) {
  return verify_input(InputFile(path), options);
}

VerifyReport verify(std::span<const std::byte> bytes, const VerifyOptions& options) {
  return verify_input(InputFile(bytes, "message"), options);
}

}  // namespace apgm
