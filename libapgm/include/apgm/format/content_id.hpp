#pragma once

#include <string>
#include <string_view>

#include "apgm/core/source.hpp"

namespace apgm {

/// The content id a Writer without loss would give the source, 32 hex digits (docs/format.md, "Content
/// hashes"). Walks all patches; reads the layers whose content hash the source does not know.
/// @throws Error{kDamaged|kUnreadable}, {kInvalidArgument} on masses out of range
std::string content_id_of(const PatchSource& source);

/// True for 32 hex digits, as content ids are written.
bool is_content_id(std::string_view text);

}  // namespace apgm
