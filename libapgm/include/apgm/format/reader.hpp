#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "apgm/core/source.hpp"

namespace apgm {

/// Facts of an .apgm file that are not part of the map.
struct FileInfo {
  std::uint64_t file_bytes = 0;
  int version_major = 0;
  int version_minor = 0;
  std::uint64_t commits = 0;            ///< number of the commit that is read; 1 in a sealed file
  bool archive = false;                 ///< may hold several commits (docs/archive.md)
  std::uint64_t uncommitted_bytes = 0;  ///< after the last commit, of an append that was interrupted or is
                                        ///< going on; they are no part of the map
};

/// One commit of an archive, or the only one of a sealed file.
struct CommitInfo {
  std::uint64_t number = 0;  ///< ascending, from 1; compacting an archive leaves gaps
  std::string content_id;    ///< 32 hex digits
  std::int64_t stamp_ns = 0;
  std::uint64_t patches = 0;
  std::uint64_t layers = 0;
  std::uint64_t added_bytes = 0;  ///< to the file, by this commit
  std::string message;
  std::vector<std::string> tags;  ///< ascending
  friend bool operator==(const CommitInfo&, const CommitInfo&) = default;
};

struct ReaderOptions {
  std::uint64_t commit = 0;  ///< number of the commit to read; 0: the last
};

/// An open .apgm file. Opening reads its head and tail; a patch is read when it is loaded. Every byte that is
/// used is checked against its checksum first.
///
/// Of an archive it reads one commit, and goes on reading that one while others append to the file or replace
/// it. Metadata of the archive itself (`apgm.archive.*`) is not in `header`.
///
/// Thread rule: all members are const after construction and may be called from any thread.
class Reader final : public PatchSource {
 public:
  /// @param path  a file, or "-" for standard input (spooled to an anonymous temporary file where it cannot
  /// seek)
  /// @throws Error{kUnreadable|kForeign|kDamaged|kUnsupported}, {kInvalidArgument} if the file has no such
  /// commit
  explicit Reader(const std::string& path, const ReaderOptions& options = {});
  /// A file's bytes in memory.
  /// @param bytes  outlive the reader
  /// @param name   stands for the path in messages
  /// @throws Error{kForeign|kDamaged|kUnsupported|kInvalidArgument}
  explicit Reader(std::span<const std::byte> bytes, const std::string& name = "message",
                  const ReaderOptions& options = {});
  ~Reader() override;

  const MapHeader& header() const override;
  Summary summary() const override;
  std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>& range = {}) const override;
  void load(const LayerInfo& info, Layer& out) const override;
  bool load_stored(const LayerInfo& info, StoredLayer& out) const override;
  std::string content_id() const override;
  const FileInfo& file() const;
  /// The commits up to the last one, oldest first; reads the header of each.
  /// @throws Error{kDamaged|kUnsupported|kUnreadable}
  std::vector<CommitInfo> commits() const;
  const std::string& path() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace apgm
