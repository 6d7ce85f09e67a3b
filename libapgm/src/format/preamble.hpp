#pragma once

#include "block.hpp"
#include "input_file.hpp"

namespace apgm::format {

/// Bit of Preamble::compat: the file may hold several commits, and its end may be torn.
inline constexpr std::uint32_t kCompatArchive = 1;

inline bool is_archive(const Preamble& preamble) { return (preamble.compat & kCompatArchive) != 0; }

/// The preamble of a file, checked.
/// @throws Error{kForeign} with a guess at what it is, {kDamaged|kUnsupported|kUnreadable}
Preamble read_preamble(const InputFile& file);

/// The 64 bytes of a preamble, its hash set.
Preamble make_preamble(bool archive);

}  // namespace apgm::format
