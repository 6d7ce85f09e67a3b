#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apgm/format/reader.hpp"
#include "apgm/ops/changes_source.hpp"
#include "tools/common/options.hpp"
#include "tools/common/session.hpp"
#include "tools/common/stream.hpp"

namespace apgm::tools {

/// --delta, --stream, --mtu: what brings one map to another, as a file that 'apgm-merge --apply' takes
/// (docs/delta.md), or as a stream of changes (docs/format.md, "Streams").
class DeltaOutput {
 public:
  void add(CLI::App& app);
  bool given() const { return path_.has_value(); }
  const std::string& path() const { return path_.value(); }
  /// Before anything is read: it is a file, none of `inputs`, and can be written.
  /// @throws Error{kInvalidArgument|kOutput}
  void check(Session& session, const std::vector<std::string>& inputs, bool overwrite);
  /// Before anything is written. @throws Error{kIncompatible} if the frames differ, or a map is itself a
  /// delta
  void check_maps(const Reader& base, const Reader& other) const;
  /// Writes it; adds the member `delta` to the document. @throws Error{kLimit|kOutput} as Writer
  void write(Session& session, const Reader& base, const Reader& other, const HeavyOptions& heavy) const;

 private:
  WriteReport write_file(Session& session, const ChangesSource& changes, const MessageEnd& ids,
                         const RunOptions& run) const;
  StreamWritten write_stream(Session& session, const ChangesSource& changes, const MessageEnd& ids,
                             const RunOptions& run) const;

  std::optional<std::string> path_;
  OutputChoice output_;
  StreamWriting stream_;
};

}  // namespace apgm::tools
