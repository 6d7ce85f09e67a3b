#include "located.hpp"

namespace apgm::format {
namespace {

Error damaged(const InputFile& file, std::uint64_t offset, const std::string& what, const char* hint) {
  return Error(ErrorCode::kDamaged,
               "'" + file.path() + "' is damaged: " + what + " at byte " + std::to_string(offset))
      .hint(hint)
      .at(file.path(), offset);
}

}  // namespace

void fail_damaged(const InputFile& file, std::uint64_t offset, const std::string& what, const char* hint) {
  throw damaged(file, offset, what, hint);
}

std::string name_of(PatchIndex patch, const std::string& layer) {
  return "patch (" + std::to_string(patch.x) + "," + std::to_string(patch.y) + ") layer '" + layer + "'";
}

Error located_error(const InputFile& file, std::uint64_t offset, const std::string& where, const Error& error,
                    const char* hint) {
  const std::string text = where.empty() ? error.message() : where + ": " + error.message();
  if (error.code() == ErrorCode::kDamaged) return damaged(file, offset, text, hint);
  return Error(error.code(), "'" + file.path() + "': " + text).hint(error.hint()).at(file.path(), offset);
}

}  // namespace apgm::format
