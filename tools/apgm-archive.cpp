#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <memory>

#include "apgm/format/archive.hpp"
#include "apgm/format/reader.hpp"
#include "apgm/format/writer.hpp"
#include "apgm/ops/copy.hpp"
#include "apgm/ops/crop.hpp"
#include "tools/common/archive_commands.hpp"
#include "tools/common/exit_code.hpp"
#include "tools/common/options.hpp"
#include "tools/common/report.hpp"
#include "tools/common/signals.hpp"
#include "tools/common/suggest.hpp"

namespace apgm::tools {
namespace {

const std::vector<std::string> kCommands{"commit", "log", "checkout", "compact", "tag"};

bool is_number(const std::string& text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

class LogCommand final : public Tool {
 public:
  ToolInfo info() const override {
    return {.verb = "archive",
            .summary = "log: list the commits of an archive",
            .usage = "log [OPTIONS] ARCHIVE",
            .details = {"Newest first: number, time, start of the content id, patches, layers, bytes the "
                        "commit added to the file, tags and message. With --json oldest first, and whole."},
            .examples = {{"apgm-archive log site.apgm", "what is in an archive"}},
            .exit_codes = {}};
  }
  void add_options(CLI::App&) override {}
  void check(Session&, const std::vector<std::string>& inputs) override {
    archive_ = archive_operands(inputs, "log", {"ARCHIVE"}, 1)[0];
  }

  void run(Session& session) override {
    const Reader reader(archive_);
    step_opened(session, archive_, reader);
    const std::vector<CommitInfo> commits = reader.commits();
    Json list = Json::array();
    TextTable table({">commit", "time", "content id", ">patches", ">layers", ">added", "tags", "message"});
    for (const CommitInfo& c : commits) {
      list.push_back({{"number", c.number},
                      {"content_id", c.content_id},
                      {"stamp_ns", c.stamp_ns != 0 ? Json(c.stamp_ns) : Json()},
                      {"patches", c.patches},
                      {"layers", c.layers},
                      {"added_bytes", c.added_bytes},
                      {"message", c.message},
                      {"tags", c.tags}});
    }
    for (auto c = commits.rbegin(); c != commits.rend(); ++c) {
      table.add({std::to_string(c->number), time_text(c->stamp_ns), c->content_id.substr(0, 12),
                 count_text(c->patches), count_text(c->layers), size_text(c->added_bytes), join(c->tags),
                 first_line(c->message)});
    }
    session.result()["archive"] = archive_;
    session.result()["bytes"] = reader.file().file_bytes;
    session.result()["uncommitted_bytes"] = reader.file().uncommitted_bytes;
    session.result()["commits"] = std::move(list);
    session.print(table.text());
  }

 private:
  std::string archive_;
};

class CheckoutCommand final : public Tool {
 public:
  ToolInfo info() const override {
    return {.verb = "archive",
            .summary = "checkout: write a commit of an archive as a map of its own",
            .usage = "checkout [OPTIONS] ARCHIVE -o OUTPUT",
            .details = {"Layers are copied as they are stored: the map is, byte for byte, what was "
                        "committed, if that was written by the same version at the same level.",
                        "With --salvage layers that are damaged are left out, and told. 'apgm-verify "
                        "--recover' saves more, also where index or header are damaged, but only of the last "
                        "commit."},
            .examples = {{"apgm-archive checkout site.apgm --at 3 -o then.apgm", "commit 3"},
                         {"apgm-archive checkout site.apgm --at 2026-01-31T12:00:00Z -o then.apgm",
                          "the map as it was at a time"},
                         {"apgm-archive checkout site.apgm --at 3 --salvage -o rest.apgm",
                          "what is whole of a damaged commit"}},
            .exit_codes = {
                {kExitUsage, "the command line cannot be used, or ARCHIVE has no commit that --at means"},
                {kExitLoss, "written, but damaged layers were left out (--salvage)"},
                archive_output_fails(),
                {kExitLimit, "a limit of the format or the budget is met"}}};
  }

  void add_options(CLI::App& app) override {
    add_text(app, kArchiveGroup, "--at", at_, "N|TAG|TIME",
             fmt::format("a number, a tag, or a time: the last commit, by number, whose time is not later "
                         "(default: the last). A time is {}",
                         kTimeForms));
    add_switch(app, kArchiveGroup, "--salvage", salvage_,
               "leave out layers that are damaged, instead of failing");
    output_.add(app);
    heavy_.add(app);
  }

  void check(Session& session, const std::vector<std::string>& inputs) override {
    archive_ = archive_operands(inputs, "checkout", {"ARCHIVE"}, 1)[0];
    if (at_ && archive_ == "-") throw usage_error("--at needs an archive that is a file");
    if (at_ && is_number(*at_)) {
      number_ = parse_commit("--at", *at_, 1);
    } else if (at_ && !may_be_given(*at_)) {
      time_ns_ = parse_time("--at", *at_);
    }
    heavy_.check();
    output_.check(session, {archive_});
    warn_of_extension(session, output_.path, ".apgm");
  }

  void run(Session& session) override {
    const Reader reader(archive_, {.commit = find_commit()});
    step_opened(session, archive_, reader);
    session.result()["archive"] = archive_;
    session.result()["commit"] = reader.file().commits;
    if (output_.dry_run) return report_dry_run(session, output_);
    session.check_cancelled();
    WriterOptions options;
    options.output = output_.options();
    Writer writer(output_.path, reader.header(), options);
    copy_layers(session, reader, writer);
    session.check_cancelled();
    writer.finish();
    report_written(session, output_, writer.report());
  }

 private:
  void copy_layers(Session& session, const Reader& reader, Writer& writer) const {
    const RunOptions run = session.run_options(heavy_, "checking out");
    if (salvage_) {
      CropOptions options;
      options.salvage = true;
      session.result()["layers_left_out"] = crop(reader, CropRegion(), options, writer, run).salvaged;
      return;
    }
    try {
      copy(reader, reader.header().types, writer, false, run);
    } catch (Error& e) {
      if (e.code() == ErrorCode::kDamaged) e.hint("--salvage keeps the layers of the commit that are whole");
      throw;
    }
  }

  std::uint64_t find_commit() const {
    if (!at_ || number_) return number_.value_or(0);
    const std::vector<CommitInfo> commits = Reader(archive_).commits();
    for (const CommitInfo& c : commits) {
      if (!time_ns_ && std::ranges::find(c.tags, *at_) != c.tags.end()) return c.number;
    }
    for (auto c = commits.rbegin(); time_ns_ && c != commits.rend(); ++c) {
      if (c->stamp_ns != 0 && c->stamp_ns <= *time_ns_) return c->number;
    }
    const bool stamped = std::ranges::any_of(commits, [](const CommitInfo& c) { return c.stamp_ns != 0; });
    const std::string what = !time_ns_ ? fmt::format("has no tag '{}'", *at_)
                             : stamped ? fmt::format("has no commit as early as {}", *at_)
                                       : "has no commit with a time";
    throw Error(ErrorCode::kInvalidArgument, fmt::format("'{}' {}", archive_, what))
        .hint(fmt::format("'apgm-archive log {}' lists them", archive_))
        .at(archive_);
  }

  std::string archive_;
  std::optional<std::string> at_;
  std::optional<std::uint64_t> number_;
  std::optional<std::int64_t> time_ns_;
  bool salvage_ = false;
  OutputChoice output_;
  HeavyOptions heavy_;
};

class CompactCommand final : public Tool {
 public:
  ToolInfo info() const override {
    return {.verb = "archive",
            .summary = "compact: write an archive anew, without what is no longer needed",
            .usage = "compact [OPTIONS] ARCHIVE [-o OUTPUT]",
            .details = {"Drops commits that are not kept, ends of interrupted commits and replaced tags; "
                        "stores equal layers once. Commits keep their numbers. Without -o the archive is "
                        "replaced by a rename when the new one is whole; readers that have it open go on "
                        "reading the old one."},
            .examples = {{"apgm-archive compact --keep 30 site.apgm",
                          "the last 30 commits, and those that have a tag"}},
            .exit_codes = {archive_output_fails(),
                           {kExitLimit, "a limit of the format or the budget is met"},
                           {kExitIncompatible, "ARCHIVE is a sealed map"}}};
  }

  void add_options(CLI::App& app) override {
    add_text(app, kArchiveGroup, "--keep", keep_, "N",
             "keep the last N commits and those with a tag (default: all)");
    add_text(app, "Output", "-o,--output", output_, "FILE", "write to another file (default: in place)");
    add_switch(app, "Output", "-O,--overwrite", options_.overwrite, "replace that file");
    heavy_.add(app);
  }

  void check(Session&, const std::vector<std::string>& inputs) override {
    archive_ = archive_operands(inputs, "compact", {"ARCHIVE"}, 1)[0];
    if (keep_) options_.keep = parse_commit("--keep", *keep_, 1);
    heavy_.check();
    if (options_.overwrite && !output_) throw usage_error("-O is for the file that -o names");
    if (!output_) return;
    if (*output_ == "-") throw usage_error("an archive is not written to standard output", "name a file");
    check_output_path(*output_, options_.overwrite, {archive_});
    options_.output = *output_;
  }

  void run(Session& session) override {
    options_.cancelled = [&] { return cancel_flag().load(); };
    const RunOptions run = session.run_options(heavy_, "compacting", ProgressUnit::kBytes);
    options_.max_memory_bytes = run.max_memory_bytes;
    options_.progress = run.progress;
    session.check_cancelled();
    const CompactReport report = compact_archive(archive_, options_);
    warn_of_cut(session, archive_, report.torn);
    const std::string& output = options_.output.empty() ? archive_ : options_.output;
    Json& result = session.result();
    result["archive"] = archive_;
    result["output"] = output;
    result["bytes_before"] = report.file_bytes_before;
    result["bytes"] = report.file_bytes;
    result["commits_before"] = report.commits_before;
    result["commits"] = report.commits;
    session.done(fmt::format("wrote '{}': {} of {}, {} of {}", output, report.commits,
                             plural(report.commits_before, "commit", "commits"), size_text(report.file_bytes),
                             size_text(report.file_bytes_before)));
  }

 private:
  std::string archive_;
  std::optional<std::string> keep_, output_;
  CompactOptions options_;
  HeavyOptions heavy_;
};

class TagCommand final : public Tool {
 public:
  ToolInfo info() const override {
    return {.verb = "archive",
            .summary = "tag: name a commit of an archive",
            .usage = "tag [OPTIONS] ARCHIVE NAME [N]",
            .details = {"NAME then stands for commit N, or the last one, wherever a commit is asked for. A "
                        "name that is taken moves."},
            .examples = {{"apgm-archive tag site.apgm accepted 12", "name commit 12"},
                         {"apgm-archive tag --delete site.apgm accepted", "take the name away"}},
            .exit_codes = {archive_output_fails(), {kExitIncompatible, "ARCHIVE is a sealed map"}}};
  }

  void add_options(CLI::App& app) override {
    add_switch(app, kArchiveGroup, "--delete", delete_, "take the name away");
  }

  void check(Session&, const std::vector<std::string>& inputs) override {
    const auto names = archive_operands(inputs, "tag", {"ARCHIVE", "NAME", "N"}, 2);
    archive_ = names[0];
    name_ = names[1];
    if (!delete_) check_tag("NAME", name_);
    if (names.size() < 3) return;
    if (delete_) throw usage_error("--delete takes no number");
    number_ = parse_commit("N", names[2], 1);
  }

  void run(Session& session) override {
    session.result()["archive"] = archive_;
    session.result()["tag"] = name_;
    TornEnd torn;
    if (delete_) {
      remove_tag(archive_, name_, &torn);
      warn_of_cut(session, archive_, torn);
      session.result()["commit"] = Json();
      return session.done(fmt::format("no commit of '{}' is '{}' any more", archive_, name_));
    }
    const std::uint64_t number = tag_commit(archive_, name_, number_, &torn);
    warn_of_cut(session, archive_, torn);
    session.result()["commit"] = number;
    session.done(fmt::format("commit {} of '{}' is '{}'", number, archive_, name_));
  }

 private:
  std::string archive_, name_;
  std::uint64_t number_ = 0;
  bool delete_ = false;
};

/// apgm-archive without a command: its help, and complaints.
class Overview final : public Tool {
 public:
  ToolInfo info() const override {
    return {.verb = "archive",
            .summary = "keep the history of a map in one file",
            .usage = "commit|log|checkout|compact|tag [OPTIONS] ARCHIVE ...",
            .details = {"An archive is an .apgm file with several commits. Each stores only the layers that "
                        "changed; every other tool reads the last one. 'apgm-archive COMMAND --help' tells "
                        "the options of a command:",
                        "commit: add a map", "log: list the commits",
                        "checkout: write a commit as a map of its own",
                        "compact: drop old commits and write the file anew", "tag: name a commit"},
            .examples = {{"apgm-archive commit site.apgm monday.apgm -m 'first survey'",
                          "make an archive, or add to it"},
                         {"apgm-archive log site.apgm", "what is in it"},
                         {"apgm-archive checkout site.apgm --at 1 -o monday.apgm", "a map of the past"}},
            .exit_codes = {archive_output_fails(),
                           {kExitLimit, "a limit of the format or the budget is met"},
                           {kExitIncompatible, "a map and an archive do not fit together"}}};
  }
  void add_options(CLI::App&) override {}
  void check(Session&, const std::vector<std::string>& inputs) override {
    check_inputs(inputs);
    if (std::ranges::find(kCommands, inputs[0]) != kCommands.end()) {
      throw usage_error(fmt::format("the command '{}' must stand first", inputs[0]),
                        fmt::format("apgm-archive {} [OPTIONS] ...", inputs[0]));
    }
    throw usage_error(
        fmt::format("unknown command '{}'", inputs[0]),
        did_you_mean(inputs[0], kCommands, "the command stands first: " + join(kCommands, ", ")));
  }
  void run(Session&) override {}
};

std::unique_ptr<Tool> tool_for(const std::string& command) {
  if (command == "commit") return archive_commit_command();
  if (command == "log") return std::make_unique<LogCommand>();
  if (command == "checkout") return std::make_unique<CheckoutCommand>();
  if (command == "compact") return std::make_unique<CompactCommand>();
  if (command == "tag") return std::make_unique<TagCommand>();
  return std::make_unique<Overview>();
}

/// The first argument: behind options it might be the value of one.
std::string command_of(int argc, char** argv) { return argc > 1 ? argv[1] : ""; }

}  // namespace
}  // namespace apgm::tools

int main(int argc, char** argv) {
  const auto tool = apgm::tools::tool_for(apgm::tools::command_of(argc, argv));
  return apgm::tools::run_tool(*tool, argc, argv);
}
