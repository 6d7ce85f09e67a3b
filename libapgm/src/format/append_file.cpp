#include "append_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "apgm/core/error.hpp"

namespace apgm::format {
namespace {

constexpr std::size_t kBufferBytes = std::size_t{1} << 18;
/// Each time the file was replaced between opening and locking it.
constexpr int kAttempts = 100;

constexpr const char* kState = "the archive is as it was, or at worst holds the new commit";

[[noreturn]] void fail(const std::string& path, const char* what, int error) {
  Error e(ErrorCode::kOutput, "cannot " + std::string(what) + " '" + path + "': " + std::strerror(error));
  e.at(path);
  if (error == ENOSPC || error == EDQUOT) e.hint(std::string("free some space; ") + kState);
  if (error == EFBIG) {
    e.hint(
        std::string("raise the limit of file sizes of this process ('ulimit -f') or of the file system; ") +
        kState);
  }
  throw e;
}

/// @param st  what it is
int open_regular(const std::string& path, struct stat& st) {
  const int fd = ::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) fail(path, "open", errno);
  const int error = ::fstat(fd, &st) != 0 ? errno : 0;
  if (error == 0 && S_ISREG(st.st_mode)) return fd;
  ::close(fd);
  if (error != 0) fail(path, "open", error);
  throw no_regular_file(path);
}

}  // namespace

Error no_regular_file(const std::string& path) {
  return Error(ErrorCode::kOutput, "'" + path + "' is not a regular file")
      .hint("an archive is a file on a disk")
      .at(path);
}

void check_may_write(const std::string& path) {
  struct stat st {};
  ::close(open_regular(path, st));
}

Error another_writes(const std::string& path) {
  return Error(ErrorCode::kOutput, "another process writes to '" + path + "'")
      .hint("try again when it is done; readers need not wait")
      .at(path);
}

LockedFile::LockedFile(const std::string& path) : path_(path) {
  for (int i = 0; i < kAttempts; ++i) {
    if (lock()) return;
  }
  fail(path_, "lock", EAGAIN);
}

/// False if the path names another file by now: compacting an archive replaces it.
bool LockedFile::lock() {
  struct stat mine {
  }, named{};
  fd_ = open_regular(path_, mine);
  int error = ::flock(fd_, LOCK_EX | LOCK_NB) != 0 ? errno : 0;
  if (error == 0 && ::fstat(fd_, &mine) != 0) error = errno;
  const bool same = error == 0 && ::stat(path_.c_str(), &named) == 0 && named.st_dev == mine.st_dev &&
                    named.st_ino == mine.st_ino;
  if (same) {
    size_ = static_cast<std::uint64_t>(mine.st_size);
    return true;
  }
  ::close(std::exchange(fd_, -1));
  if (error == 0) return false;
  if (error != EWOULDBLOCK) fail(path_, "lock", error);
  throw another_writes(path_);
}

LockedFile::~LockedFile() {
  if (fd_ >= 0) ::close(fd_);
}

void LockedFile::read(std::uint64_t offset, std::span<std::byte> out) const {
  while (!out.empty()) {
    const ssize_t n = ::pread(fd_, out.data(), out.size(), static_cast<off_t>(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      const char* why = n < 0 ? std::strerror(errno) : "it became shorter";
      throw Error(ErrorCode::kUnreadable, "cannot read '" + path_ + "': " + why).at(path_, offset);
    }
    out = out.subspan(static_cast<std::size_t>(n));
    offset += static_cast<std::uint64_t>(n);
  }
}

void LockedFile::write_at(std::uint64_t offset, Bytes bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::pwrite(fd_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) fail(path_, "write", n < 0 ? errno : EIO);
    bytes = bytes.subspan(static_cast<std::size_t>(n));
    offset += static_cast<std::uint64_t>(n);
  }
}

void LockedFile::write_out() {
  write_at(size_, buffer_);
  size_ += buffer_.size();
  buffer_.clear();
}

void LockedFile::rewrite(std::uint64_t offset, Bytes bytes) { write_at(offset, bytes); }

void LockedFile::write(Bytes bytes) {
  buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  if (buffer_.size() >= kBufferBytes) write_out();
}

void LockedFile::sync() {
  write_out();
  if (::fdatasync(fd_) != 0) fail(path_, "flush", errno);
}

void LockedFile::cut(std::uint64_t size) {
  buffer_.clear();
  int done = 0;
  do {
    done = ::ftruncate(fd_, static_cast<off_t>(size));
  } while (done != 0 && errno == EINTR);
  if (done != 0) fail(path_, "shorten", errno);
  size_ = size;
}

}  // namespace apgm::format
