#include "tools/common/session.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "apgm/core/budget.hpp"
#include "tools/common/exit_code.hpp"
#include "tools/common/memory.hpp"
#include "tools/common/options.hpp"
#include "tools/common/signals.hpp"

namespace apgm::tools {
namespace {

constexpr const char* kRed = "31";
constexpr const char* kYellow = "33";
constexpr const char* kBlue = "34";
/// What a process takes beside its work: code that is read in, stacks of threads, buffers of files, and what
/// the allocator cannot give back.
constexpr std::uint64_t kReserveBytes = std::uint64_t{6} << 20;

/// @return 0 or errno
int write_all(int fd, const std::string& text) {
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t n = ::write(fd, text.data() + done, text.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return errno;
    done += static_cast<std::size_t>(n);
  }
  return 0;
}

}  // namespace

bool stdout_is_broken() {
  struct pollfd out {
    STDOUT_FILENO, POLLOUT, 0
  };
  return ::poll(&out, 1, 0) > 0 && (out.revents & POLLERR) != 0;
}

Session::Session(std::string verb) : verb_(std::move(verb)), start_(Progress::Clock::now()) {}
Session::~Session() = default;

bool Session::color_on(int fd) const {
  if (color != Color::kAuto) return color == Color::kAlways;
  const char* no_color = std::getenv("NO_COLOR");
  if (no_color != nullptr && *no_color != '\0') return false;
  const char* term = std::getenv("TERM");
  return ::isatty(fd) == 1 && term != nullptr && std::strcmp(term, "dumb") != 0;
}

void Session::write_error(const std::string& text) {
  if (progress_) progress_->erase();
  (void)write_all(STDERR_FILENO, text);
}

void Session::say(const char* kind, const char* sgr, const std::string& text) {
  const std::string word =
      color_on(STDERR_FILENO) ? fmt::format("\x1b[1;{}m{}:\x1b[0m", sgr, kind) : std::string(kind) + ":";
  write_error(fmt::format("{}: {} {}\n", tool(), word, visible_text(text)));
}

void Session::note(const std::string& text) {
  notes_.push_back(text);
  if (!quiet) say("note", kBlue, text);
}

void Session::warning(const std::string& text) {
  warnings_.push_back(text);
  if (!quiet) say("warning", kYellow, text);
}

void Session::loss(const std::string& text) {
  losses_.push_back(text);
  if (!quiet) say("warning", kYellow, "lost: " + text);
}

void Session::step(const std::string& text) {
  if (verbose) say("note", kBlue, text);
}

void Session::done(const std::string& text) {
  if (quiet || (!verbose && ::isatty(STDERR_FILENO) != 1)) return;
  say("note", kBlue, text);
}

Findings Session::findings() {
  return [this](const Finding& finding) {
    switch (finding.kind) {
      case Finding::Kind::kNote:
        return note(finding.text);
      case Finding::Kind::kWarning:
        return warning(finding.text);
      case Finding::Kind::kLoss:
        return loss(finding.text);
    }
  };
}

std::uint64_t Session::memory_left(const HeavyOptions& heavy) {
  if (heavy.max_memory_bytes == 0) return 0;
  give_back_free_memory();
  held_bytes_ = resident_bytes() + kReserveBytes;
  return heavy.max_memory_bytes > held_bytes_ ? heavy.max_memory_bytes - held_bytes_ : 1;
}

std::string Session::memory_hint(const Error& error) const {
  const auto hint = budget_hint(error);
  if (!hint) return {};
  const std::uint64_t mebibytes = hint->least_mebibytes + (held_bytes_ >> 20) + 1;
  return fmt::format("pass --max-memory with at least {} MiB{}", mebibytes, hint->rest);
}

RunOptions Session::run_options(const HeavyOptions& heavy, const std::string& label, ProgressUnit unit) {
  RunOptions run;
  run.threads = heavy.threads;
  run.max_memory_bytes = memory_left(heavy);
  run.cancel = &cancel_flag();
  run.findings = findings();
  const bool shown = heavy.progress.value_or(::isatty(STDERR_FILENO) == 1 && !quiet);
  if (shown) {
    progress_ = std::make_unique<Progress>(
        label, [](const std::string& text) { (void)write_all(STDERR_FILENO, text); }, Progress::Clock::now,
        unit);
    run.progress = [this](std::uint64_t done, std::uint64_t total) { progress_->update(done, total); };
  }
  return run;
}

void Session::check_cancelled() const {
  if (cancel_flag()) throw Error(ErrorCode::kCancelled, "interrupted");
}

void Session::fail(const std::string& code, const std::string& message, const std::string& hint,
                   const std::string& path, std::optional<std::uint64_t> offset_bytes) {
  say("error", kRed, message);
  if (!hint.empty()) write_error("hint: " + visible_text(hint) + "\n");
  const auto or_null = [](const std::string& text) { return text.empty() ? Json() : Json(text); };
  result_ = {{"error",
              {{"code", code},
               {"message", message},
               {"hint", or_null(hint)},
               {"path", or_null(path)},
               {"offset_bytes", offset_bytes ? Json(*offset_bytes) : Json()}}}};
}

int Session::flush_output() {
  if (progress_) progress_->erase();
  if (json) {
    result_["schema"] = "apgm." + verb_ + "/1";
    result_["notes"] = notes_;
    result_["warnings"] = warnings_;
    result_["losses"] = losses_;
    text_ = to_text(result_) + "\n";
  }
  const int error = stdout_is_output ? 0 : write_all(STDOUT_FILENO, text_);
  text_.clear();
  if (error == EPIPE) return kExitPipe;
  if (error != 0) {
    say("error", kRed, fmt::format("cannot write to standard output: {}", std::strerror(error)));
    return kExitOutput;
  }
  return kExitDone;
}

int Session::finish() {
  if (const int code = flush_output(); code != kExitDone) return code;
  if (verbose) {
    const double seconds = std::chrono::duration<double>(Progress::Clock::now() - start_).count();
    step(fmt::format("took {:.2f} s, peak memory {}", seconds, size_text(peak_memory_bytes())));
  }
  if (!losses_.empty()) return kExitLoss;
  return no_ ? kExitNo : kExitDone;
}

}  // namespace apgm::tools
