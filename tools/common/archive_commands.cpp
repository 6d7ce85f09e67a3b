#include <fmt/chrono.h>
#include <fmt/format.h>

#include <CLI/App.hpp>
#include <filesystem>

#include "apgm/core/text.hpp"
#include "apgm/format/archive.hpp"
#include "apgm/format/reader.hpp"
#include "apgm/ops/apply.hpp"
#include "apgm/ops/changes_source.hpp"
#include "apgm/ops/copy.hpp"
#include "tools/common/archive_commands.hpp"
#include "tools/common/exit_code.hpp"
#include "tools/common/options.hpp"
#include "tools/common/report.hpp"

namespace apgm::tools {

std::pair<int, std::string> archive_output_fails() {
  return {kExitOutput,
          "the output is not permitted, another process writes to the archive, or the disk is full"};
}

/// What follows the command's own word.
std::vector<std::string> archive_operands(const std::vector<std::string>& inputs, const std::string& command,
                                          const std::vector<std::string>& names, std::size_t required) {
  std::vector<std::string> result(inputs.begin() + 1, inputs.end());
  if (result.size() < required) {
    throw usage_error(fmt::format("{} needs {}", command, names[result.size()]),
                      fmt::format("apgm-archive {} {}", command, join(names, " ")));
  }
  if (result.size() > names.size()) {
    throw usage_error(fmt::format("unexpected argument '{}'", result[names.size()]),
                      fmt::format("apgm-archive {} {}", command, join(names, " ")));
  }
  for (std::size_t i = 0; i < result.size(); ++i) {
    if (result[i].empty()) throw usage_error(fmt::format("{} is an empty text", names[i]));
  }
  check_inputs(result);
  if (result[0] == "-" && command != "log" && command != "checkout") {
    throw usage_error("an archive that is written to must be a file");
  }
  return result;
}

void warn_of_cut(Session& session, const std::string& archive, const TornEnd& torn) {
  session.result()["cut_bytes"] = torn.bytes;
  session.result()["cut_layers"] = torn.layers;
  if (torn.bytes == 0) return;
  session.warning(fmt::format(
      "cut {} with {} off '{}': they follow the last whole commit, and are of an append that was "
      "interrupted, or of a commit that was damaged since",
      plural(torn.bytes, "byte", "bytes"), plural(torn.layers, "whole layer", "whole layers"), archive));
}

std::uint64_t parse_commit(const std::string& option, const std::string& text, std::int64_t least) {
  return static_cast<std::uint64_t>(parse_integer(option, text, least, INT64_MAX, "commits count from 1"));
}

std::string time_text(std::int64_t stamp_ns) {
  if (stamp_ns == 0) return "-";
  constexpr std::int64_t kSecond = 1'000'000'000;
  const std::int64_t seconds = stamp_ns / kSecond - (stamp_ns % kSecond < 0 ? 1 : 0);
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(static_cast<std::time_t>(seconds)));
}

void check_tag(const std::string& what, const std::string& tag) {
  if (may_be_given(tag)) return;
  throw usage_error(
      fmt::format("{}: '{}' cannot be a tag", what, tag),
      is_tag_name(tag)
          ? fmt::format("--at {} is a time", tag)
          : "a tag starts with a letter or '_', then letters, digits and '_.+-'; at most 64 bytes");
}

namespace {

class CommitCommand final : public Tool {
 public:
  ToolInfo info() const override {
    return {
        .verb = "archive",
        .summary = "commit: add a map to an archive",
        .usage = "commit [OPTIONS] ARCHIVE MAP",
        .details = {"Stores the layers of MAP that differ from the last commit in cells or stamp, shares the "
                    "others. Makes the archive if there is none. Everything is on the disk when it ends; if "
                    "it fails, or the power does, the archive is as it was.",
                    "All commits of an archive have one frame: datum, patch edge, EPSG code, frame id."},
        .examples = {{"apgm-archive commit site.apgm today.apgm -m 'after the roadworks' --stamp now",
                      "a new state of a site"},
                     {"apgm-archive commit --expect 7 site.apgm mine.apgm",
                      "only if nobody committed since number 7"}},
        .exit_codes = {
            archive_output_fails(),
            {kExitLimit, "a limit of the format or the budget is met"},
            {kExitIncompatible, "the frame is another, ARCHIVE is a sealed map, or --expect fails"}}};
  }

  void add_options(CLI::App& app) override {
    add_text(app, kArchiveGroup, "-m,--message", message_, "TEXT", "what the commit is");
    add_list(app, kArchiveGroup, "--tag", commit_.tags, "NAME", "a name for the commit (repeatable)");
    add_text(app, kArchiveGroup, "--stamp", stamp_, "TIME",
             fmt::format("the time of the commit: {} (default: that of MAP)", kTimeForms));
    add_text(app, kArchiveGroup, "--expect", expect_, "N",
             "number the last commit must have; 0: the archive must be new");
    add_text(app, kArchiveGroup, "--level", level_, "1..19",
             "effort of the compression of layers that are not stored yet (default 3)");
    add_switch(app, kArchiveGroup, "-n,--dry-run", dry_run_,
               "check all that a commit checks, say what would be stored, write nothing");
    heavy_.add(app);
  }

  void check(Session&, const std::vector<std::string>& inputs) override {
    const auto names = archive_operands(inputs, "commit", {"ARCHIVE", "MAP"}, 2);
    archive_ = names[0];
    map_ = names[1];
    if (map_ != "-" && same_file(archive_, map_)) throw usage_error("ARCHIVE and MAP are the same file");
    for (const std::string& tag : commit_.tags) check_tag("--tag", tag);
    commit_.message = message_.value_or("");
    if (!is_utf8(commit_.message)) {
      throw usage_error("--message: the text is not UTF-8", "is the terminal or the script set to UTF-8?");
    }
    if (stamp_) stamp_ns_ = parse_stamp("--stamp", *stamp_);
    if (expect_) options_.expected = parse_commit("--expect", *expect_, 0);
    if (level_) options_.level = static_cast<int>(parse_integer("--level", *level_, 1, 19));
    options_.create = true;
    options_.dry_run = dry_run_;
    heavy_.check();
    std::error_code error;
    const auto status = std::filesystem::status(archive_, error);
    // It may appear before it is opened: that is told then.
    if (!std::filesystem::exists(status)) return check_output_path(archive_, true, {map_});
    if (std::filesystem::is_regular_file(status)) return;
    throw Error(ErrorCode::kOutput, fmt::format("'{}' is not a regular file", archive_))
        .hint("an archive is a file on a disk")
        .at(archive_);
  }

  void run(Session& session) override {
    const Reader map(map_);
    step_opened(session, map_, map);
    if (holds_changes(map.header())) {
      throw Error(ErrorCode::kIncompatible, fmt::format("'{}' holds changes, not a map", map_))
          .hint("apply them first: apgm-merge --apply " + map_ + " BASE -o NEW")
          .at(map_);
    }
    MapHeader header = map.header();
    if (stamp_ns_) header.stamp_ns = *stamp_ns_;
    session.result()["archive"] = archive_;
    session.result()["input"] = {{"path", map_}, {"content_id", map.content_id()}};
    session.result()["dry_run"] = dry_run_;
    ArchiveWriter writer(archive_, options_);
    if (writer.last() == nullptr) {
      writer.begin(header, {}, commit_);
      if (dry_run_) return report_dry_run(session, map, 0, 0);
      put(session, map, header, writer);
    } else {
      if (dry_run_) step_opened(session, archive_, *writer.last());
      const ChangesSource changes = changes_from(session, *writer.last(), map);
      writer.begin(header, changes.gone(), commit_);
      warn_of_time(session, header, *writer.last());
      const std::uint64_t last = writer.last()->file().commits;
      if (dry_run_) return report_dry_run(session, changes, last, changes.gone().size());
      put(session, changes, header, writer);
    }
    warn_of_cut(session, archive_, writer.torn());
    report(session, writer.report());
  }

 private:
  ChangesSource changes_from(Session& session, const Reader& last, const Reader& map) const {
    return ChangesSource(last, map, session.run_options(heavy_, "comparing"), {archive_, map_});
  }

  void put(Session& session, const PatchSource& source, const MapHeader& header, ArchiveWriter& writer) {
    session.check_cancelled();
    copy(source, header.types, writer, false, session.run_options(heavy_, "committing"));
    session.check_cancelled();
    writer.finish();
  }

  /// What `--at TIME` finds is then not what the user may think.
  static void warn_of_time(Session& session, const MapHeader& header, const Reader& last) {
    const std::int64_t before = last.header().stamp_ns;
    if (header.stamp_ns == 0 || before == 0 || header.stamp_ns >= before) return;
    const std::uint64_t number = last.file().commits;
    session.warning(
        fmt::format("the time of commit {} ({}) is before that of commit {} ({}): no time given "
                    "with --at finds commit {} any more",
                    number + 1, time_text(header.stamp_ns), number, time_text(before), number));
  }

  static void report_dry_run(Session& session, const PatchSource& source, std::uint64_t last,
                             std::uint64_t gone) {
    std::uint64_t layers = 0;
    for (const Summary::OfType& type : source.summary().types) layers += type.layers;
    session.result()["commit"] = last + 1;
    session.result()["layers_written"] = layers;
    session.result()["layers_gone"] = gone;
    session.done(fmt::format("dry run: commit {} would store {}, {} gone", last + 1,
                             plural(layers, "layer", "layers"), gone));
  }

  void report(Session& session, const CommitReport& report) const {
    Json& result = session.result();
    result["commit"] = report.number;
    result["content_id"] = report.content_id;
    result["bytes"] = report.file_bytes;
    result["added_bytes"] = report.added_bytes;
    result["patches"] = report.patches;
    result["layers"] = report.layers;
    result["layers_written"] = report.layers_written;
    session.done(fmt::format("commit {} of '{}': {} of {} stored, {} added", report.number, archive_,
                             report.layers_written, plural(report.layers, "layer", "layers"),
                             size_text(report.added_bytes)));
  }

  std::string archive_, map_;
  std::optional<std::string> message_, stamp_, expect_, level_;
  std::optional<std::int64_t> stamp_ns_;
  bool dry_run_ = false;
  ArchiveOptions options_;
  CommitOptions commit_;
  HeavyOptions heavy_;
};

}  // namespace

std::unique_ptr<Tool> archive_commit_command() { return std::make_unique<CommitCommand>(); }

}  // namespace apgm::tools
