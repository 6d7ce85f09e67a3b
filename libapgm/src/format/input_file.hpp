#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace apgm::format {

/// A file, or bytes in memory, that is read by position. pread, not mmap: a file that another process
/// truncates must be an error, not a signal. Thread-safe.
class InputFile {
 public:
  /// "-" is standard input, spooled to an anonymous file where it cannot seek.
  /// @throws Error{kUnreadable}
  explicit InputFile(const std::string& path);
  /// Bytes that outlive it, under a name for messages.
  InputFile(std::span<const std::byte> bytes, std::string name);
  ~InputFile();
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;

  std::uint64_t size() const { return size_; }
  const std::string& path() const { return path_; }
  /// Fills `out` from `offset`. @throws Error{kUnreadable} on I/O errors, {kDamaged} past the end
  void read(std::uint64_t offset, std::span<std::byte> out) const;

 private:
  std::string path_;
  std::span<const std::byte> memory_;
  int fd_ = -1;  // -1: in memory
  std::uint64_t size_ = 0;
};

}  // namespace apgm::format
