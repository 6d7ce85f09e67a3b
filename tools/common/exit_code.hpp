#pragma once

#include "apgm/core/error.hpp"

namespace apgm::tools {

/// Exit codes of every apgm tool. Frozen: scripts depend on them.
enum ExitCode : int {
  kExitDone = 0,           ///< done, equal, valid
  kExitNo = 1,             ///< the answer is no
  kExitUsage = 2,          ///< the command line cannot be used
  kExitLoss = 3,           ///< written, with loss that is listed
  kExitInput = 4,          ///< an input is missing, unreadable, damaged or unsupported
  kExitOutput = 5,         ///< the output exists, is not permitted, or the disk is full
  kExitLimit = 6,          ///< a limit of the format, the budget or the machine is met
  kExitIncompatible = 7,   ///< inputs are valid but do not fit together
  kExitBug = 70,           ///< a bug in the tool
  kExitInterrupted = 130,  ///< ended by SIGINT or SIGTERM
  kExitPipe = 141,         ///< the reader of standard output went away
};

/// The exit code a failure of the library ends with.
int exit_code(ErrorCode code);

/// The answer of a check is no: exit code 1. For tools that ask a question or were told not to lose data.
class AnswerNo : public std::exception {
 public:
  AnswerNo(std::string message, std::string hint) : message_(std::move(message)), hint_(std::move(hint)) {}
  const std::string& message() const { return message_; }
  const std::string& hint() const { return hint_; }
  const char* what() const noexcept override { return message_.c_str(); }

 private:
  std::string message_;
  std::string hint_;
};

/// A command line that cannot be used: exit code 2.
Error usage_error(std::string message, std::string hint = {});

}  // namespace apgm::tools
