#pragma once

#include <memory>
#include <string>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/ops/run.hpp"
#include "tools/common/json.hpp"
#include "tools/common/progress.hpp"

namespace apgm::tools {

struct HeavyOptions;

enum class Color : std::uint8_t { kAuto, kAlways, kNever };

/// One run of one tool: what it says, and where. Results go to standard output, all else to standard error as
/// `apgm-x: error|warning|note: ...`. With --json the results are one document, written at the end.
class Session {
 public:
  explicit Session(std::string verb);
  ~Session();

  const std::string& verb() const { return verb_; }
  std::string tool() const { return verb_ == "apgm" ? verb_ : "apgm-" + verb_; }

  bool json = false;
  bool quiet = false;
  bool verbose = false;
  Color color = Color::kAuto;
  /// The binary result goes to standard output, which then carries nothing else.
  bool stdout_is_output = false;

  /// Text of the result, written at the end; not with --json.
  void print(const std::string& text) { text_ += text; }
  /// The document of --json; `schema` and what was found are added at the end.
  Json& result() { return result_; }

  void note(const std::string& text);
  void warning(const std::string& text);
  /// Data that did not survive: a warning now, exit code 3 at the end.
  void loss(const std::string& text);
  /// A step of the work, for -v.
  void step(const std::string& text);
  /// That a writer is done: with -v or on a terminal.
  void done(const std::string& text);
  std::size_t losses() const { return losses_.size(); }
  /// The result answers a question with no: exit code 1 at the end, without a message.
  void answer_no() { no_ = true; }
  /// The three above as a sink for the library.
  Findings findings();

  /// What is left of --max-memory beside what the process holds now and what it will hold beside its work: at
  /// least 1. 0: no bound.
  std::uint64_t memory_left(const HeavyOptions& heavy);
  /// The hint of a failure to hold the budget, in terms of --max-memory; empty if `error` is none.
  std::string memory_hint(const Error& error) const;
  /// Threads, budget, cancellation, findings, and progress under `label` where it is to be shown.
  RunOptions run_options(const HeavyOptions& heavy, const std::string& label,
                         ProgressUnit unit = ProgressUnit::kPatches);
  /// @throws Error{kCancelled} once a signal asked to stop
  void check_cancelled() const;

  /// Prints an error; with --json also makes it the document.
  void fail(const std::string& code, const std::string& message, const std::string& hint,
            const std::string& path = {}, std::optional<std::uint64_t> offset_bytes = {});
  /// Writes what was printed to standard output. @return the exit code
  int finish();
  /// Writes the text or document only: for failures. @return 0, kExitPipe or kExitOutput
  int flush_output();

  bool color_on(int fd) const;

 private:
  void say(const char* kind, const char* sgr, const std::string& text);
  void write_error(const std::string& text);

  std::string verb_;
  std::string text_;
  Json result_ = Json::object();
  std::vector<std::string> notes_, warnings_, losses_;
  bool no_ = false;
  std::unique_ptr<Progress> progress_;
  std::uint64_t held_bytes_ = 0;  ///< of --max-memory, not given to the work
  Progress::Clock::time_point start_;
};

/// True if the reader of standard output went away.
bool stdout_is_broken();

}  // namespace apgm::tools
