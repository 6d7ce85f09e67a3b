#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "apgm/core/source.hpp"
#include "apgm/format/reader.hpp"
#include "footer.hpp"
#include "index.hpp"
#include "input_file.hpp"

namespace apgm::format {

/// Metadata of an archive (docs/format.md, "Archives"): no part of the map.
inline constexpr const char* kArchiveKeys = "apgm.archive.";
inline constexpr const char* kTagsKey = "apgm.archive.tags";
inline constexpr const char* kMessageKey = "apgm.archive.message";

using Tags = std::map<std::string, std::uint64_t>;

/// @throws Error{kDamaged} if the text is not a list of tags as `to_text` writes it
Tags parse_tags(const std::string& text);
std::string to_text(const Tags& tags);
/// Tags in a header as it is stored.
Tags tags_of(const MapHeader& header);

/// Takes `apgm.archive.*` out.
void strip_archive_keys(MapHeader& header);

/// What of a commit is in memory while a file is open.
struct OpenCommit {
  FooterAt at;
  MapHeader header;  ///< as stored
  Root root;
};

/// Reads and checks header and root of a commit; for most maps that is one read from the end.
/// @throws Error{kDamaged|kUnsupported|kUnreadable} located
OpenCommit open_commit(const InputFile& file, const FooterAt& at);

/// The map header of a commit, as stored.
/// @throws Error{kDamaged|kUnsupported|kUnreadable} located
MapHeader header_of(const InputFile& file, const FooterAt& at);

/// The last footer of commit `number`, 0: `last`. @throws Error{kInvalidArgument} if there is no such commit
FooterAt find_commit(const InputFile& file, const FooterAt& last, std::uint64_t number);

/// Of footers as footer_chain gives them the last of each commit, oldest first.
std::vector<FooterAt> last_of_each(const std::vector<FooterAt>& chain);

/// The log of an archive, oldest first; reads the header of each commit.
/// @throws Error{kDamaged|kUnsupported|kUnreadable} located
std::vector<CommitInfo> log_of(const InputFile& file, const FooterAt& last);

}  // namespace apgm::format
