#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "apgm/format/output_file.hpp"
#include "apgm/format/stream.hpp"
#include "apgm/format/stream_map.hpp"
#include "apgm/ops/apply.hpp"
#include "tools/common/options.hpp"
#include "tools/common/session.hpp"

namespace apgm::tools {

/// --stream, --mtu: blocks that are useful one by one, in place of a file.
struct StreamWriting {
  bool on = false;
  std::uint32_t mtu_bytes = 0;

  void add(CLI::App& app, const std::string& group);
  /// @throws Error{kInvalidArgument}
  void check();
  StreamOptions options(const MapWriting& writing) const;

 private:
  std::optional<std::string> mtu_text_;
};

/// A stream on its way to a file or standard output.
class StreamFile {
 public:
  StreamFile(const OutputChoice& output, const MapHeader& header, const StreamOptions& options);
  StreamWriter& writer() { return writer_; }
  /// Gives the file its name, and tells of it: the members output, bytes, blocks, messages, layers and
  /// dry_run of the document. @throws Error{kOutput}
  void commit(Session& session, const OutputChoice& output);

 private:
  OutputFile file_;
  StreamWriter writer_;
};

/// Reads a stream to its end.
/// @param path     a file, or "-" for standard input
/// @param scratch  directory for what is kept meanwhile
/// @param salvage  what is missing is told as loss
/// @throws Error{kDamaged|kUnsupported} if anything is missing, unless `salvage`; without a map header in any
///         case; {kIncompatible} if it holds changes of another map; {kUnreadable}
std::unique_ptr<StreamMap> read_stream(Session& session, const std::string& path, const std::string& scratch,
                                       bool salvage);

/// A map, from its base and a stream of changes (StreamMap::start_from).
/// @param result  a document that tells of the stream: its member `stream`
/// @param names   for messages; that of the delta is the stream's path
/// @throws Error{kDamaged|kUnsupported} if anything is missing, or the stream does not lead to the map it
///         names, or names none; {kForeign} if it names no base; {kIncompatible} as check_base();
///         {kUnreadable}
std::unique_ptr<StreamMap> apply_stream(Session& session, const PatchSource& base, const ApplyNames& names,
                                        const std::string& scratch, Json& result);

}  // namespace apgm::tools
