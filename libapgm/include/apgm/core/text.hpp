#pragma once

#include <string_view>

namespace apgm {

/// True if `text` is UTF-8 without overlong forms, surrogates or NUL.
bool is_utf8(std::string_view text);

/// True if `text` is UTF-8 and holds no control characters (below 0x20, and 0x7f).
bool is_plain_text(std::string_view text);

}  // namespace apgm
