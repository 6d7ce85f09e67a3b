#pragma once

#include <cstdint>
#include <exception>
#include <functional>
#include <optional>
#include <string>

namespace apgm {

/// What went wrong, as far as a caller can act on it. The tools map these to their exit codes (docs/cli).
enum class ErrorCode : std::uint8_t {
  kInvalidArgument,  ///< a value the caller passed cannot be used
  kUnreadable,       ///< an input is missing or cannot be read
  kForeign,          ///< an input is not what it was taken for
  kDamaged,          ///< an input fails a check
  kUnsupported,      ///< an input is whole but needs a newer or another reader
  kOutput,           ///< an output exists, is not permitted, or the disk is full
  kLimit,            ///< a limit of the format, the budget or the machine is met
  kIncompatible,     ///< inputs are valid but do not fit together
  kCancelled,        ///< the caller asked to stop
};

/// Name of a code in snake_case, as it stands in JSON: "damaged".
const char* to_string(ErrorCode code);

/// The one exception of the library: a fact, and where known a hint, a file and a byte in it.
class Error : public std::exception {
 public:
  Error(ErrorCode code, std::string message) : code_(code), message_(std::move(message)) {}

  /// What to do about it; one line, no full stop.
  Error& hint(std::string text) {
    hint_ = std::move(text);
    return *this;
  }
  /// The file it happened in, and the byte where known. Does not replace a path that is already set.
  Error& at(std::string path, std::optional<std::uint64_t> offset_bytes = {});

  ErrorCode code() const { return code_; }
  const std::string& message() const { return message_; }
  const std::string& hint() const { return hint_; }
  const std::string& path() const { return path_; }
  std::optional<std::uint64_t> offset_bytes() const { return offset_bytes_; }
  const char* what() const noexcept override { return message_.c_str(); }

 private:
  ErrorCode code_;
  std::string message_;
  std::string hint_;
  std::string path_;
  std::optional<std::uint64_t> offset_bytes_;
};

/// Receives non-fatal findings, one line each. The library never prints.
struct Finding {
  enum class Kind : std::uint8_t {
    kNote,     ///< worth knowing
    kWarning,  ///< probably not what was meant
    kLoss,     ///< data that did not survive; the tools exit with 3
  };
  Kind kind = Kind::kNote;
  std::string text;
};
using Findings = std::function<void(const Finding&)>;

}  // namespace apgm
