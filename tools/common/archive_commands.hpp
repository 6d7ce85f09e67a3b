#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "apgm/format/archive.hpp"
#include "tools/common/app.hpp"

namespace apgm::tools {

// The commands of apgm-archive. Each is a tool of its own; the command's word is its first input.

std::unique_ptr<Tool> archive_commit_command();

inline constexpr const char* kArchiveGroup = "Archive";
/// Exit code 5, as all of them tell it.
std::pair<int, std::string> archive_output_fails();

/// What follows the command's word. @throws Error{kInvalidArgument} unless there are `required` to all of
/// `names`
std::vector<std::string> archive_operands(const std::vector<std::string>& inputs, const std::string& command,
                                          const std::vector<std::string>& names, std::size_t required);
/// Warns of what was cut off the end of an archive, where anything was.
void warn_of_cut(Session& session, const std::string& archive, const TornEnd& torn);
/// The number of a commit, at least `least`.
std::uint64_t parse_commit(const std::string& option, const std::string& text, std::int64_t least);
/// The time of a commit in UTC, "-" if it has none.
std::string time_text(std::int64_t stamp_ns);
/// @throws Error{kInvalidArgument} if the text cannot be a tag
void check_tag(const std::string& what, const std::string& tag);

}  // namespace apgm::tools
