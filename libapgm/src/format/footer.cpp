#include "footer.hpp"

#include <algorithm>
#include <optional>
#include <string>

#include "apgm/core/error.hpp"
#include "index.hpp"
#include "located.hpp"
#include "map_header.hpp"

namespace apgm::format {
namespace {

constexpr std::uint64_t kWindowBytes = 64 * 1024;

[[noreturn]] void fail(const char* what) { throw Error(ErrorCode::kDamaged, what); }

template <typename Mark>
std::size_t right_bytes(Bytes bytes, const Mark& mark) {
  std::size_t right = 0;
  for (std::size_t i = 0; i < mark.size(); ++i) {
    if (bytes[i] == static_cast<std::byte>(mark[i])) ++right;
  }
  return right;
}

/// A torn write leaves the start or the end of a footer, never both: where both are there, but for one byte,
/// it was whole once.
bool was_footer(Bytes block) {
  return right_bytes(block, kSync) + right_bytes(block.last(kTail.size()), kTail) + 1 >=
         kSync.size() + kTail.size();
}

/// The last whole footer of `window` before its byte `before`; the window starts at the file's byte `at`.
std::optional<FooterAt> last_footer_in(Bytes window, std::uint64_t at, std::uint64_t before) {
  for (std::uint64_t end = before; end >= 8; end -= 8) {
    const std::uint64_t i = end - 8;
    if (i + kFooterBlockBytes > window.size()) continue;
    const Bytes block = window.subspan(i, kFooterBlockBytes);
    if (right_bytes(block, kSync) != kSync.size() || block[8] != static_cast<std::byte>(Kind::kFooter))
      continue;
    try {
      return parse_footer(block, at + i);
    } catch (const Error&) {
      continue;  // blocks of an append hold any bytes
    }
  }
  return std::nullopt;
}

/// Windows overlap by a footer, so that each lies wholly in one.
Tail scan_back(const InputFile& file) {
  std::vector<std::byte> window;
  std::uint64_t from = (file.size() - kFooterBlockBytes) / 8 * 8 + 8;  // footers start before
  while (from > sizeof(Preamble)) {
    const std::uint64_t at = std::max<std::uint64_t>(sizeof(Preamble), from - std::min(from, kWindowBytes));
    window.resize(std::min(file.size(), from + kFooterBlockBytes) - at);
    file.read(at, window);
    if (const auto found = last_footer_in(window, at, from - at)) {
      return {*found, file.size() - found->end()};
    }
    from = at;
  }
  fail_damaged(file, file.size(), "the archive holds no commit that is whole");
}

}  // namespace

FooterAt parse_footer(Bytes bytes, std::uint64_t offset) {
  const Block block = parse_block(bytes, Kind::kFooter);
  if (!block.meta.empty() || block.body.size() != sizeof(Footer)) fail("the footer is malformed");
  FooterAt at{offset, read_as<Footer>(block.body)};
  const Footer& f = at.footer;
  const auto inside = [&](std::uint64_t start, std::uint64_t size) {
    return start >= sizeof(Preamble) && start % 8 == 0 && start <= offset && size <= offset - start;
  };
  if (f.tail != kTail || f.file_bytes != at.end() || f.commits < 1 || f.patches > f.layers ||
      std::any_of(f.reserved.begin(), f.reserved.end(), [](auto v) { return v != 0; }) ||
      !inside(f.header_offset, f.header_bytes) || f.header_bytes > kMaxHeaderBytes + 4096 ||
      !inside(f.root_offset, f.root_bytes) || f.root_bytes > kMaxRootBytes + 4096 ||
      (f.previous_footer != 0 && !inside(f.previous_footer, kFooterBlockBytes))) {
    fail("the footer does not fit the file");
  }
  return at;
}

Tail find_last_footer(const InputFile& file, bool archive) {
  if (file.size() < sizeof(Preamble) + kFooterBlockBytes) {
    fail_damaged(file, file.size(), "the file is cut short, its index is missing");
  }
  std::vector<std::byte> end(kFooterBlockBytes);
  const std::uint64_t offset = file.size() - kFooterBlockBytes;
  file.read(offset, end);
  try {
    return {parse_footer(end, offset), 0};
  } catch (const Error& e) {
    if (!archive || e.code() != ErrorCode::kDamaged || was_footer(end)) {
      throw located_error(file, offset, "the file's end is not a footer, it may be cut short", e, kCopyAgain);
    }
  }
  return scan_back(file);
}

FooterAt previous_footer(const InputFile& file, const FooterAt& from) {
  const std::uint64_t offset = from.footer.previous_footer;
  std::vector<std::byte> bytes(kFooterBlockBytes);
  file.read(offset, bytes);
  return located(file, offset, "the footer of an earlier commit", [&] {
    const FooterAt before = parse_footer(bytes, offset);
    if (before.footer.commits > from.footer.commits) fail("its number is greater than that of the next");
    return before;
  });
}

std::vector<FooterAt> footer_chain(const InputFile& file, const FooterAt& last) {
  std::vector<FooterAt> chain{last};
  while (chain.back().footer.previous_footer != 0) chain.push_back(previous_footer(file, chain.back()));
  return chain;
}

}  // namespace apgm::format
