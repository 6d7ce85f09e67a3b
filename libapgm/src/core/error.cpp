#include "apgm/core/error.hpp"

namespace apgm {

const char* to_string(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidArgument:
      return "invalid_argument";
    case ErrorCode::kUnreadable:
      return "unreadable";
    case ErrorCode::kForeign:
      return "foreign";
    case ErrorCode::kDamaged:
      return "damaged";
    case ErrorCode::kUnsupported:
      return "unsupported";
    case ErrorCode::kOutput:
      return "output";
    case ErrorCode::kLimit:
      return "limit";
    case ErrorCode::kIncompatible:
      return "incompatible";
    case ErrorCode::kCancelled:
      return "cancelled";
  }
  return "unknown";
}

Error& Error::at(std::string path, std::optional<std::uint64_t> offset_bytes) {
  if (path_.empty()) path_ = std::move(path);
  if (!offset_bytes_) offset_bytes_ = offset_bytes;
  return *this;
}

}  // namespace apgm
