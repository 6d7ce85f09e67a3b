#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace apgm::format {

/// A file without a name, read and written by position; gone when closed. Reading is thread-safe.
class ScratchFile {
 public:
  /// @throws Error{kOutput}
  explicit ScratchFile(std::string directory);
  ~ScratchFile();
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;

  /// @throws Error{kOutput} on a full disk or any other failure
  void write(std::uint64_t offset, std::span<const std::byte> bytes);
  /// @throws Error{kUnreadable} on I/O errors, {kDamaged} past the end
  void read(std::uint64_t offset, std::span<std::byte> out) const;
  /// Gives the space beyond `size` back.
  void truncate(std::uint64_t size);
  const std::string& directory() const { return directory_; }

 private:
  std::string directory_;
  int fd_ = -1;
};

}  // namespace apgm::format
