#pragma once

#include <cstdint>
#include <vector>

#include "block.hpp"
#include "input_file.hpp"

namespace apgm::format {

/// A footer block and the byte it starts at.
struct FooterAt {
  std::uint64_t offset = 0;
  Footer footer;
  std::uint64_t end() const { return offset + kFooterBlockBytes; }
};

/// Takes the whole block of a footer apart that lies at `offset`: it ends a file of the size it says, and
/// what it names lies before it.
/// @throws Error{kDamaged|kUnsupported} without path or offset
FooterAt parse_footer(Bytes block, std::uint64_t offset);

/// The end of a file.
struct Tail {
  FooterAt last;
  std::uint64_t uncommitted_bytes = 0;  ///< of an append that was interrupted or is going on
};

/// The last footer of a file (docs/format.md, "The end of an archive"). Of a sealed file it must be the very
/// end. Reads backwards no further than that footer, in windows.
/// @throws Error{kDamaged} located
Tail find_last_footer(const InputFile& file, bool archive);

/// The footer before `from`, checked against it: it lies before, and its number is not greater.
/// @throws Error{kDamaged} located; `from.footer.previous_footer` must not be 0
FooterAt previous_footer(const InputFile& file, const FooterAt& from);

/// The footers from `last` back to the oldest, newest first: one for each commit and each time its header was
/// replaced, which shows as equal numbers.
/// @throws Error{kDamaged} located
std::vector<FooterAt> footer_chain(const InputFile& file, const FooterAt& last);

}  // namespace apgm::format
