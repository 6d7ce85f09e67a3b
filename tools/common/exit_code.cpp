#include "tools/common/exit_code.hpp"

namespace apgm::tools {

int exit_code(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidArgument:
      return kExitUsage;
    case ErrorCode::kUnreadable:
    case ErrorCode::kForeign:
    case ErrorCode::kDamaged:
    case ErrorCode::kUnsupported:
      return kExitInput;
    case ErrorCode::kOutput:
      return kExitOutput;
    case ErrorCode::kLimit:
      return kExitLimit;
    case ErrorCode::kIncompatible:
      return kExitIncompatible;
    case ErrorCode::kCancelled:
      return kExitInterrupted;
  }
  return kExitBug;
}

Error usage_error(std::string message, std::string hint) {
  Error error(ErrorCode::kInvalidArgument, std::move(message));
  error.hint(std::move(hint));
  return error;
}

}  // namespace apgm::tools
