#include "tools/common/report.hpp"

#include <fmt/format.h>

#include "apgm/format/reader.hpp"
#include "apgm/ops/apply.hpp"

namespace apgm::tools {

void report_written(Session& session, const OutputChoice& output, const WriteReport& report) {
  if (report.patches == 0) session.note("the result holds no patches");
  Json& result = session.result();
  result["output"] = output.path;
  result["dry_run"] = false;
  result["bytes"] = report.file_bytes;
  result["patches"] = report.patches;
  result["layers"] = report.layers;
  result["content_id"] = report.content_id;
  session.done(fmt::format("wrote '{}': {}, {}, {}", output.path, plural(report.patches, "patch", "patches"),
                           plural(report.layers, "layer", "layers"), size_text(report.file_bytes)));
}

void warn_of_delta(Session& session, const std::string& path, const MapHeader& header) {
  if (!holds_changes(header)) return;
  session.warning(
      fmt::format("'{}' is a delta: what becomes of it is a map of what changed, and no delta", path));
}

void report_dry_run(Session& session, const OutputChoice& output) {
  session.result()["output"] = output.path;
  session.result()["dry_run"] = true;
  session.done(fmt::format("dry run: '{}' is not written", output.path));
}

std::string first_line(const std::string& text) {
  const std::size_t end = text.find('\n');
  const std::string line = visible_text(std::string_view(text).substr(0, end));
  return end == std::string::npos ? line : line + " ...";
}

void step_opened(Session& session, const std::string& path, const PatchSource& source) {
  const auto* reader = dynamic_cast<const Reader*>(&source);
  if (reader != nullptr && reader->file().uncommitted_bytes > 0) {
    session.warning(fmt::format("'{}' ends with {} bytes of a commit that is not whole; commit {} is read",
                                path, reader->file().uncommitted_bytes, reader->file().commits));
  }
  if (!session.verbose) return;
  const Summary summary = source.summary();
  std::uint64_t stored = 0, raw = 0;
  for (const Summary::OfType& type : summary.types) {
    stored += type.stored_bytes;
    raw += type.raw_bytes;
  }
  session.step(fmt::format("opened '{}': {}, {} of values, {} stored", path,
                           plural(summary.patches, "patch", "patches"), size_text(raw), size_text(stored)));
}

}  // namespace apgm::tools
