#include "apgm/core/text.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace apgm {
namespace {

/// Bytes of the sequence that `lead` begins, 0 if none.
std::size_t sequence_bytes(unsigned char lead) {
  if (lead < 0x80) return 1;
  if (lead < 0xc2) return 0;  // continuation, or an overlong form of ASCII
  if (lead < 0xe0) return 2;
  if (lead < 0xf0) return 3;
  return lead < 0xf5 ? 4 : 0;
}

/// Least code point that needs `bytes` bytes.
std::uint32_t least_code(std::size_t bytes) { return bytes == 3 ? 0x800 : bytes == 4 ? 0x10000 : 0; }

}  // namespace

bool is_utf8(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const auto lead = static_cast<unsigned char>(text[i]);
    const std::size_t bytes = sequence_bytes(lead);
    if (bytes == 0 || bytes > text.size() - i || lead == 0) return false;
    std::uint32_t code = bytes == 1 ? lead : lead & (0x7fu >> bytes);
    for (std::size_t k = 1; k < bytes; ++k) {
      const auto byte = static_cast<unsigned char>(text[i + k]);
      if ((byte & 0xc0) != 0x80) return false;
      code = code << 6 | (byte & 0x3fu);
    }
    if (code < least_code(bytes) || code > 0x10ffff || (code >= 0xd800 && code <= 0xdfff)) return false;
    i += bytes;
  }
  return true;
}

bool is_plain_text(std::string_view text) {
  return is_utf8(text) &&
         std::none_of(text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; });
}

}  // namespace apgm
