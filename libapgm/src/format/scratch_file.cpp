#include "scratch_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "apgm/core/error.hpp"

namespace apgm::format {
namespace {

[[noreturn]] void fail(ErrorCode code, const char* what, const std::string& directory, int error) {
  Error e(code,
          "cannot " + std::string(what) + " a scratch file in '" + directory + "': " + std::strerror(error));
  e.at(directory);
  if (error == ENOSPC || error == EDQUOT) e.hint("free some space or choose another directory for it");
  throw e;
}

/// Where the file system has no files without a name: one whose name is taken at once.
int open_and_unlink(const std::string& directory) {
  std::string name = directory + "/.apgm-XXXXXX";
  const int fd = ::mkostemp(name.data(), O_CLOEXEC);
  if (fd >= 0) ::unlink(name.c_str());
  return fd;
}

}  // namespace

ScratchFile::ScratchFile(std::string directory) : directory_(std::move(directory)) {
  if (directory_.empty()) directory_ = ".";
  fd_ = ::open(directory_.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  if (fd_ < 0 && (errno == EOPNOTSUPP || errno == EISDIR || errno == EINVAL)) {
    fd_ = open_and_unlink(directory_);
  }
  if (fd_ < 0) fail(ErrorCode::kOutput, "create", directory_, errno);
}

ScratchFile::~ScratchFile() { ::close(fd_); }

void ScratchFile::write(std::uint64_t offset, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::pwrite(fd_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail(ErrorCode::kOutput, "write", directory_, errno);
    offset += static_cast<std::uint64_t>(n);
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
}

void ScratchFile::read(std::uint64_t offset, std::span<std::byte> out) const {
  while (!out.empty()) {
    const ssize_t n = ::pread(fd_, out.data(), out.size(), static_cast<off_t>(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail(ErrorCode::kUnreadable, "read", directory_, errno);
    if (n == 0) {
      throw Error(ErrorCode::kDamaged, "the scratch file in '" + directory_ + "' became shorter")
          .at(directory_, offset);
    }
    offset += static_cast<std::uint64_t>(n);
    out = out.subspan(static_cast<std::size_t>(n));
  }
}

void ScratchFile::truncate(std::uint64_t size) {
  // Space that is not given back is only space.
  if (::ftruncate(fd_, static_cast<off_t>(size)) != 0) return;
}

}  // namespace apgm::format
