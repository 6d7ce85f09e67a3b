#pragma once

#include <cstdint>
#include <string>

#include "apgm/core/error.hpp"
#include "apgm/core/source.hpp"
#include "input_file.hpp"

namespace apgm::format {

inline constexpr const char* kCopyAgain =
    "get the file again from where it came; a copy may have been cut short";
inline constexpr const char* kSalvage = "'apgm-crop --salvage' keeps the layers that are whole";

[[noreturn]] void fail_damaged(const InputFile& file, std::uint64_t offset, const std::string& what,
                               const char* hint = kCopyAgain);

/// "patch (17,-3) layer 'occupancy'"
std::string name_of(PatchIndex patch, const std::string& layer);

/// `error` with the file's name and the byte, for a rule that was broken at `offset` in what `where` names
/// (may be empty).
Error located_error(const InputFile& file, std::uint64_t offset, const std::string& where, const Error& error,
                    const char* hint);

/// Runs `work`; what it finds wrong gets the file's name and the byte.
template <typename Work>
auto located(const InputFile& file, std::uint64_t offset, const std::string& where, Work work,
             const char* hint = kCopyAgain) {
  try {
    return work();
  } catch (const Error& e) {
    if (!e.path().empty()) throw;
    throw located_error(file, offset, where, e, hint);
  }
}

}  // namespace apgm::format
