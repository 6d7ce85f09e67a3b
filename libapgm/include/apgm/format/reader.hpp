#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "apgm/core/source.hpp"

namespace apgm {

/// Facts of an .apgm file that are not part of the map.
struct FileInfo {
  std::uint64_t file_bytes = 0;
  int version_major = 0;
  int version_minor = 0;
  std::uint64_t commits = 0;
};

/// An open .apgm file. Opening reads its head and tail; a patch is read when it is loaded. Every byte that is
/// used is checked against its checksum first.
///
/// Thread rule: all members are const after construction and may be called from any thread.
class Reader final : public PatchSource {
 public:
  /// @param path  a file, or "-" for standard input (spooled to an anonymous temporary file where it cannot
  /// seek)
  /// @throws Error{kUnreadable|kForeign|kDamaged|kUnsupported}
  explicit Reader(const std::string& path);
  /// A file's bytes in memory.
  /// @param bytes  outlive the reader
  /// @param name   stands for the path in messages
  /// @throws Error{kForeign|kDamaged|kUnsupported}
  explicit Reader(std::span<const std::byte> bytes, const std::string& name = "message");
  ~Reader() override;

  const MapHeader& header() const override;
  Summary summary() const override;
  std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>& range = {}) const override;
  void load(const LayerInfo& info, Layer& out) const override;
  bool load_stored(const LayerInfo& info, StoredLayer& out) const override;
  std::string content_id() const override;
  const FileInfo& file() const;
  const std::string& path() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace apgm
