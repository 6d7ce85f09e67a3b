#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "apgm/core/error.hpp"
#include "block.hpp"
#include "input_file.hpp"

namespace apgm::format {

/// A file that grows at its end. What was written counts only after `sync`: a crash before may keep any part
/// of it, in any order.
class AppendFile : public ReadAt {
 public:
  virtual std::uint64_t size() const = 0;
  /// At the end. @throws Error{kOutput}; any part may then have been written
  virtual void write(Bytes bytes) = 0;
  /// The same bytes once more where they lie, before the end of what was synced. @throws Error{kOutput}
  virtual void rewrite(std::uint64_t offset, Bytes bytes) = 0;
  /// What was written and cut so far is on the disk. @throws Error{kOutput}; any part may then be, and what
  /// is not may be passed over by the next `sync`, though `read` still gives it
  virtual void sync() = 0;
  /// Takes off what lies from `size` on. @throws Error{kOutput}
  virtual void cut(std::uint64_t size) = 0;
};

/// The failure of who is not the only writer of an archive.
Error another_writes(const std::string& path);

/// The failure of what cannot be an archive: a pipe, a device.
Error no_regular_file(const std::string& path);

/// @throws Error{kOutput} if the file is not there, no regular file, or may not be written; it stays as it is
void check_may_write(const std::string& path);

/// An existing file under an exclusive lock that lasts as long as the object.
class LockedFile final : public AppendFile {
 public:
  /// @throws Error{kOutput} if it is not there, no regular file, may not be written, or is locked by another
  explicit LockedFile(const std::string& path);
  ~LockedFile() override;
  LockedFile(const LockedFile&) = delete;
  LockedFile& operator=(const LockedFile&) = delete;

  void read(std::uint64_t offset, std::span<std::byte> out) const override;
  std::uint64_t size() const override { return size_ + buffer_.size(); }
  void write(Bytes bytes) override;
  void rewrite(std::uint64_t offset, Bytes bytes) override;
  void sync() override;
  void cut(std::uint64_t size) override;

 private:
  bool lock();
  void write_at(std::uint64_t offset, Bytes bytes);
  void write_out();

  std::string path_;
  int fd_ = -1;
  std::uint64_t size_ = 0;  // without the buffer
  std::vector<std::byte> buffer_;
};

}  // namespace apgm::format
