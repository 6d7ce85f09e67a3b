#include "input_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>
#include <vector>

#include "apgm/core/error.hpp"

namespace apgm::format {
namespace {

[[noreturn]] void fail(const std::string& path, const char* what, int error) {
  throw Error(ErrorCode::kUnreadable,
              "cannot " + std::string(what) + " '" + path + "': " + std::strerror(error))
      .at(path);
}

/// Copies a stream that cannot seek into a file without a name.
int spool(int from, const std::string& path) {
  std::FILE* file = std::tmpfile();
  if (file == nullptr) fail(path, "make a temporary file for", errno);
  const int fd = ::fcntl(::fileno(file), F_DUPFD_CLOEXEC, 0);
  std::fclose(file);
  if (fd < 0) fail(path, "make a temporary file for", errno);
  std::vector<char> buffer(std::size_t{1} << 20);
  for (;;) {
    const ssize_t got = ::read(from, buffer.data(), buffer.size());
    if (got == 0) return fd;
    if (got < 0 && errno == EINTR) continue;
    ssize_t put = 0;
    while (got > put) {
      const ssize_t n = ::write(fd, buffer.data() + put, static_cast<std::size_t>(got - put));
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) break;
      put += n;
    }
    if (got < 0 || put < got) {
      const int error = errno;
      ::close(fd);
      fail(path, got < 0 ? "read" : "spool", error);
    }
  }
}

}  // namespace

InputFile::InputFile(const std::string& path) : path_(path) {
  if (path == "-") {
    fd_ = ::lseek(STDIN_FILENO, 0, SEEK_CUR) >= 0 ? ::fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 0)
                                                  : spool(STDIN_FILENO, path);
  } else {
    fd_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  }
  if (fd_ < 0) fail(path, "open", errno);
  struct stat st {};
  const bool known = ::fstat(fd_, &st) == 0;
  if (known && S_ISREG(st.st_mode)) {
    size_ = static_cast<std::uint64_t>(st.st_size);
    return;
  }
  if (known && (S_ISFIFO(st.st_mode) || S_ISSOCK(st.st_mode))) {
    const int stream = std::exchange(fd_, -1);
    try {
      fd_ = spool(stream, path);
    } catch (...) {
      ::close(stream);
      throw;
    }
    ::close(stream);
    if (::fstat(fd_, &st) == 0) size_ = static_cast<std::uint64_t>(st.st_size);
    return;
  }
  const int error = !known ? errno : S_ISDIR(st.st_mode) ? EISDIR : EINVAL;  // a device may never end
  ::close(fd_);
  fail(path, "read", error);
}

InputFile::InputFile(std::span<const std::byte> bytes, std::string name)
    : path_(std::move(name)), memory_(bytes), size_(bytes.size()) {}

InputFile::InputFile(const ReadAt& source, std::uint64_t size, std::string name)
    : path_(std::move(name)), source_(&source), size_(size) {}

InputFile::~InputFile() {
  if (fd_ >= 0) ::close(fd_);
}

bool InputFile::has_shrunk() const {
  struct stat st {};
  return fd_ >= 0 && ::fstat(fd_, &st) == 0 && static_cast<std::uint64_t>(st.st_size) < size_;
}

void InputFile::read(std::uint64_t offset, std::span<std::byte> out) const {
  if (offset > size_ || out.size() > size_ - offset) {
    throw Error(ErrorCode::kDamaged, "'" + path_ + "' is shorter than it says").at(path_, offset);
  }
  if (source_ != nullptr) return source_->read(offset, out);
  if (fd_ < 0) {
    std::ranges::copy(memory_.subspan(offset, out.size()), out.begin());
    return;
  }
  std::size_t done = 0;
  while (done < out.size()) {
    const ssize_t n = ::pread(fd_, out.data() + done, out.size() - done, static_cast<off_t>(offset + done));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail(path_, "read", errno);
    if (n == 0)
      throw Error(ErrorCode::kDamaged, "'" + path_ + "' became shorter while it was read").at(path_, offset);
    done += static_cast<std::size_t>(n);
  }
}

}  // namespace apgm::format
