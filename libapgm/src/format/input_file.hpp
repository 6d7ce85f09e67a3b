#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace apgm::format {

/// What can be read by position.
class ReadAt {
 public:
  virtual ~ReadAt() = default;
  /// Fills `out` from `offset`, which lies before its end. @throws Error{kUnreadable|kDamaged}
  virtual void read(std::uint64_t offset, std::span<std::byte> out) const = 0;
};

/// A file, or bytes in memory, that is read by position. pread, not mmap: a file that another process
/// truncates must be an error, not a signal. Thread-safe.
class InputFile {
 public:
  /// "-" is standard input, spooled to an anonymous file where it cannot seek.
  /// @throws Error{kUnreadable}
  explicit InputFile(const std::string& path);
  /// Bytes that outlive it, under a name for messages.
  InputFile(std::span<const std::byte> bytes, std::string name);
  /// The first `size` bytes of something that outlives it, under a name for messages.
  InputFile(const ReadAt& source, std::uint64_t size, std::string name);
  ~InputFile();
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;

  std::uint64_t size() const { return size_; }
  const std::string& path() const { return path_; }
  /// Fills `out` from `offset`. @throws Error{kUnreadable} on I/O errors, {kDamaged} past the end
  void read(std::uint64_t offset, std::span<std::byte> out) const;
  /// True if the file is shorter now than when it was opened.
  bool has_shrunk() const;

 private:
  std::string path_;
  std::span<const std::byte> memory_;
  const ReadAt* source_ = nullptr;
  int fd_ = -1;  // -1: in memory, or `source_`
  std::uint64_t size_ = 0;
};

}  // namespace apgm::format
