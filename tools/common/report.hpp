#pragma once

#include <string>

#include "apgm/format/writer.hpp"
#include "tools/common/options.hpp"
#include "tools/common/session.hpp"

namespace apgm::tools {

/// Tells of a map that was written: the members output, bytes, patches, layers, content_id and dry_run of the
/// document, a line for -v or a terminal, and a note if the map is empty.
void report_written(Session& session, const OutputChoice& output, const WriteReport& report);

/// Warns where a delta goes into an operation whose result is none (drop_changes).
void warn_of_delta(Session& session, const std::string& path, const MapHeader& header);

/// The same where nothing was written because of --dry-run.
void report_dry_run(Session& session, const OutputChoice& output);

/// Warns where an archive ends with a commit that is not whole. For -v: what an input holds.
void step_opened(Session& session, const std::string& path, const PatchSource& source);

/// The first line of a commit's message, as it may be shown on a terminal; " ..." tells of more.
std::string first_line(const std::string& text);

}  // namespace apgm::tools
