#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>

#include "apgm/format/reader.hpp"
#include "apgm/format/recover.hpp"
#include "apgm/format/verify.hpp"
#include "apgm/format/writer.hpp"
#include "apgm/ops/copy.hpp"
#include "tools/common/app.hpp"
#include "tools/common/exit_code.hpp"
#include "tools/common/options.hpp"
#include "tools/common/report.hpp"

namespace apgm::tools {
namespace {

constexpr const char* kRecoverGroup = "Recovery";

/// A problem and a loss have the same members.
template <typename Place>
Json place_json(const Place& place) {
  return {{"text", place.text},
          {"offset_bytes", place.offset},
          {"patch", place.patch ? Json({place.patch->x, place.patch->y}) : Json()},
          {"layer", place.layer.empty() ? Json() : Json(place.layer)}};
}

template <typename Place>
Json list_json(const std::vector<Place>& places) {
  Json list = Json::array();
  for (const Place& place : places) list.push_back(place_json(place));
  return list;
}

std::string more_text(std::uint64_t count, std::size_t listed) {
  return count > listed ? fmt::format("and {} more", count_text(count - listed)) : std::string();
}

class VerifyTool final : public Tool {
 public:
  ToolInfo info() const override {
    return {.verb = "verify",
            .summary = "check an .apgm file, save what is whole of a damaged one",
            .usage = "[OPTIONS] INPUT [--recover -o OUTPUT]",
            .details = {"Reads the whole file and checks every byte against its checksum, and what the index "
                        "says against what is there, over all commits of an archive. Lists every fault with "
                        "the patch, the layer and the byte; ends with exit code 1 if there is one.",
                        "With --recover what is whole is written to a new file: that of the last commit, of "
                        "which layers that are lost are listed. A single flipped bit is found by its "
                        "checksum and turned back. Nothing is guessed. Older commits of an archive are left "
                        "out, and counted; 'apgm-archive checkout --salvage' saves one of those."},
            .examples = {{"apgm-verify site.apgm", "is the file as it was written?"},
                         {"apgm-verify --deep site.apgm", "decode every layer too"},
                         {"apgm-verify --recover damaged.apgm -o rest.apgm",
                          "save what is whole; exit code 3 if anything is lost"},
                         {"apgm-verify --recover --header-from older.apgm damaged.apgm -o rest.apgm",
                          "the map's own header is lost"}},
            .exit_codes = {{kExitNo, "the file is damaged, or its last append was interrupted"},
                           {kExitLoss, "written, but something was lost (--recover)"},
                           {kExitOutput, "the output exists, is not permitted, or the disk is full"},
                           {kExitLimit, "a limit of the format or the budget is met"}}};
  }

  void add_options(CLI::App& app) override {
    add_switch(app, "Check", "--deep", verify_.deep, "decode every layer and check its cells");
    add_switch(app, kRecoverGroup, "--recover", recover_, "write what is whole to the output");
    add_text(app, kRecoverGroup, "--header-from", header_from_, "FILE",
             "a map with the same frame and layer types, for a file whose own header is lost");
    output_.add(app);
    heavy_.add(app);
  }

  void check(Session& session, const std::vector<std::string>& inputs) override {
    input_ = one_input(inputs);
    heavy_.check();
    if (recover_) {
      if (verify_.deep) throw usage_error("--deep and --recover exclude each other");
      std::vector<std::string> read{input_};
      if (header_from_) read.push_back(*header_from_);
      check_inputs(read);
      output_.check(session, read);
      warn_of_extension(session, output_.path, ".apgm");
      return;
    }
    if (header_from_) throw usage_error("--header-from needs --recover");
    if (output_.given()) throw usage_error("nothing is written without --recover");
  }

  void run(Session& session) override { recover_ ? recover(session) : verify_file(session); }

 private:
  void verify_file(Session& session) {
    const RunOptions run = session.run_options(heavy_, "checking", ProgressUnit::kBytes);
    verify_.threads = run.threads;
    verify_.max_memory_bytes = run.max_memory_bytes;
    verify_.cancel = run.cancel;
    verify_.progress = run.progress;
    const VerifyReport report = verify(input_, verify_);
    tell(session, report);
    if (!report.valid()) session.answer_no();
  }

  void tell(Session& session, const VerifyReport& report) const {
    session.result()["input"] = input_;
    session.result()["valid"] = report.valid();
    session.result()["deep"] = verify_.deep;
    session.result()["bytes"] = report.file_bytes;
    session.result()["archive"] = report.archive;
    session.result()["commits"] = report.commits;
    session.result()["blocks"] = report.blocks;
    session.result()["layers"] = report.layers;
    session.result()["decoded_layers"] = report.decoded_layers;
    session.result()["unknown_blocks"] = report.unknown_blocks;
    session.result()["uncommitted_bytes"] = report.uncommitted_bytes;
    session.result()["content_id"] = report.content_id.empty() ? Json() : Json(report.content_id);
    session.result()["problem_count"] = report.problem_count;
    session.result()["problems"] = list_json(report.problems);
    for (const Problem& problem : report.problems) {
      session.print(fmt::format("byte {}: {}\n", problem.offset, problem.text));
    }
    if (const auto more = more_text(report.problem_count, report.problems.size()); !more.empty()) {
      session.print(more + "\n");
    }
    session.print(verdict(report));
  }

  std::string verdict(const VerifyReport& report) const {
    const std::string whole =
        fmt::format("{} in {}", plural(report.layers, "layer", "layers"), size_text(report.file_bytes));
    if (report.problem_count > 0) {
      return fmt::format("'{}' is damaged: {}; whole are {}\nhint: {}\n", input_,
                         plural(report.problem_count, "fault", "faults"), whole,
                         report.commits > 1
                             ? "apgm-verify --recover -o OUTPUT saves those of the last commit, "
                               "apgm-archive checkout --salvage --at N those of an older one"
                             : "apgm-verify --recover -o OUTPUT saves them");
    }
    if (report.uncommitted_bytes > 0) {
      return fmt::format(
          "'{}' is torn: {} after the last commit, of an append that was interrupted or is going on; all "
          "before are whole\nhint: the next commit removes them\n",
          input_, plural(report.uncommitted_bytes, "byte", "bytes"));
    }
    const std::string commits =
        report.archive ? fmt::format(", {}", plural(report.commits, "commit", "commits")) : "";
    return fmt::format("'{}' is valid: {}{}, content id {}\n", input_, whole, commits, report.content_id);
  }

  void recover(Session& session) {
    const RunOptions run = session.run_options(heavy_, "reading", ProgressUnit::kBytes);
    RecoverOptions options;
    options.threads = run.threads;
    options.max_memory_bytes = run.max_memory_bytes;
    options.cancel = run.cancel;
    options.progress = run.progress;
    std::optional<Reader> other;
    if (header_from_) options.header = &other.emplace(*header_from_).header();
    const Recovery recovery = open(options);
    tell_losses(session, recovery.report());
    if (output_.dry_run) return report_dry_run(session, output_);
    session.check_cancelled();
    Writer writer(output_.path, recovery.header(), {.output = output_.options()});
    copy(recovery, recovery.header().types, writer, false, session.run_options(heavy_, "writing"));
    session.check_cancelled();
    writer.finish();
    report_written(session, output_, writer.report());
  }

  Recovery open(const RecoverOptions& options) const {
    try {
      return Recovery(input_, options);
    } catch (HeaderLost& e) {
      e.hint("pass --header-from with another map that has the same frame and layer types");
      throw;
    }
  }

  static void tell_losses(Session& session, const RecoverReport& report) {
    session.result()["commit"] = report.commit;
    session.result()["older_commits"] = report.older_commits;
    session.result()["index"] = report.index;
    session.result()["repaired_blocks"] = report.repaired;
    session.result()["uncommitted_bytes"] = report.uncommitted_bytes;
    session.result()["uncommitted_layers"] = report.uncommitted_layers;
    session.result()["loss_count"] = report.loss_count;
    session.result()["lost"] = list_json(report.losses);
    if (report.repaired > 0) {
      session.note(
          fmt::format("a flipped bit was turned back in {}", plural(report.repaired, "block", "blocks")));
    }
    if (report.older_commits > 0) {
      session.note(
          fmt::format("only commit {} is written: {} of the archive {} left out; 'apgm-archive checkout "
                      "--salvage --at N' saves one",
                      report.commit, plural(report.older_commits, "older commit", "older commits"),
                      report.older_commits == 1 ? "is" : "are"));
    }
    if (report.uncommitted_bytes > 0) {
      session.note(fmt::format("{} of an append that was interrupted are left out",
                               plural(report.uncommitted_bytes, "byte", "bytes")));
    }
    for (const Loss& loss : report.losses) session.loss(loss.text);
    if (const auto more = more_text(report.loss_count, report.losses.size()); !more.empty()) {
      session.loss(more);
    }
  }

  std::string input_;
  bool recover_ = false;
  std::optional<std::string> header_from_;
  VerifyOptions verify_;
  OutputChoice output_;
  HeavyOptions heavy_;
};

}  // namespace
}  // namespace apgm::tools

int main(int argc, char** argv) {
  apgm::tools::VerifyTool tool;
  return apgm::tools::run_tool(tool, argc, argv);
}
