#include "converters/scans/lzf.hpp"

#include <algorithm>
#include <cstddef>

namespace apgm::converters {

bool unpack_lzf(std::span<const unsigned char> in, std::span<unsigned char> out) {
  constexpr unsigned kLiteral = 32, kLongLength = 7;
  std::size_t from = 0, to = 0;
  while (from < in.size()) {
    const unsigned control = in[from++];
    if (control < kLiteral) {  // control + 1 bytes as they are
      const std::size_t n = control + 1;
      if (n > in.size() - from || n > out.size() - to) return false;
      std::copy_n(in.begin() + static_cast<std::ptrdiff_t>(from), n,
                  out.begin() + static_cast<std::ptrdiff_t>(to));
      from += n;
      to += n;
      continue;
    }
    // 3 bits of length - 2 (7: another byte follows that is added), 13 bits of distance - 1.
    std::size_t n = control >> 5;
    if (n == kLongLength) {
      if (from == in.size()) return false;
      n += in[from++];
    }
    n += 2;
    if (from == in.size()) return false;
    const std::size_t distance = ((control & 31u) << 8 | in[from++]) + 1;
    if (distance > to || n > out.size() - to) return false;
    for (std::size_t i = 0; i < n; ++i, ++to) out[to] = out[to - distance];  // may overlap
  }
  return to == out.size();
}

}  // namespace apgm::converters
