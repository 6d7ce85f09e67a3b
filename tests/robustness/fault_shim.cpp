// Preloaded into a tool: makes its calls to the system fail as a disk would make them.
//
// APGM_FAULT_DIR    only calls on files below this directory count; an absolute path without links
// APGM_FAULT        KIND:N:ERRNO   the N-th call of the kind fails, N from 1; 0: none
//                   KIND:*:short   reads and writes move a few bytes at a time
//                   KIND:*:eintr   every other call is interrupted first
// APGM_FAULT_COUNT  file that is told how many calls of the kind there were
//
// Kinds: read, write, sync, rename, create.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

namespace {

enum class How { kNever, kOnce, kShort, kInterrupted };

struct Plan {
  std::string directory, kind, count_file;
  How how = How::kNever;
  long at = 0;
  int error = EIO;

  Plan() {
    const auto variable = [](const char* name) {
      const char* text = std::getenv(name);
      return std::string(text == nullptr ? "" : text);
    };
    directory = variable("APGM_FAULT_DIR");
    count_file = variable("APGM_FAULT_COUNT");
    const std::string fault = variable("APGM_FAULT");
    const auto first = fault.find(':'), second = fault.find(':', first + 1);
    if (second == std::string::npos) return;
    kind = fault.substr(0, first);
    const std::string what = fault.substr(second + 1);
    how = what == "short" ? How::kShort : what == "eintr" ? How::kInterrupted : How::kOnce;
    if (how != How::kOnce) return;
    at = std::atol(fault.c_str() + first + 1);
    error = std::atoi(what.c_str());
  }
};

const Plan& plan() {
  static const Plan* const one = new Plan;  // outlives all that runs at the end
  return *one;
}

std::atomic<long> calls{0};

bool is_ours(const std::string& path) { return path.starts_with(plan().directory); }

bool is_ours(int fd) {
  char path[4096];
  const std::string link = "/proc/self/fd/" + std::to_string(fd);
  const ssize_t size = ::readlink(link.c_str(), path, sizeof path);
  return size > 0 && is_ours(std::string(path, static_cast<std::size_t>(size)));
}

/// What a path names, were it made: its directory without links.
bool is_ours(const char* path) {
  if (path == nullptr) return false;
  const std::string text = path;
  const auto slash = text.rfind('/');
  const std::string directory = slash == std::string::npos ? "." : slash == 0 ? "/" : text.substr(0, slash);
  char* real = ::realpath(directory.c_str(), nullptr);
  if (real == nullptr) return false;
  const bool ours = is_ours(std::string(real));
  std::free(real);
  return ours;
}

/// Counts a call; true if it is to fail, with errno set.
template <typename Where>
bool fails(const char* kind, Where where) {
  if (plan().kind != kind || !is_ours(where)) return false;
  const long number = ++calls;
  const bool now = (plan().how == How::kOnce && number == plan().at) ||
                   (plan().how == How::kInterrupted && number % 2 == 1);
  if (now) errno = plan().how == How::kInterrupted ? EINTR : plan().error;
  return now;
}

std::size_t shortened(const char* kind, std::size_t size, int fd) {
  if (plan().how != How::kShort || plan().kind != kind || size < 2 || !is_ours(fd)) return size;
  return size > 4000 ? 1 + size / 3 : 1 + size / 2;
}

template <typename Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(::dlsym(RTLD_NEXT, name));
}

__attribute__((destructor)) void tell() {
  if (plan().count_file.empty()) return;
  if (std::FILE* file = std::fopen(plan().count_file.c_str(), "w")) {
    std::fprintf(file, "%ld\n", calls.load());
    std::fclose(file);
  }
}

}  // namespace

extern "C" {

ssize_t read(int fd, void* out, size_t size) {
  static const auto real = next<ssize_t (*)(int, void*, size_t)>("read");
  return fails("read", fd) ? -1 : real(fd, out, shortened("read", size, fd));
}

ssize_t pread(int fd, void* out, size_t size, off_t at) {
  static const auto real = next<ssize_t (*)(int, void*, size_t, off_t)>("pread");
  return fails("read", fd) ? -1 : real(fd, out, shortened("read", size, fd), at);
}

ssize_t pread64(int fd, void* out, size_t size, off64_t at) { return pread(fd, out, size, at); }

ssize_t write(int fd, const void* from, size_t size) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t)>("write");
  return fails("write", fd) ? -1 : real(fd, from, shortened("write", size, fd));
}

ssize_t pwrite(int fd, const void* from, size_t size, off_t at) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t, off_t)>("pwrite");
  return fails("write", fd) ? -1 : real(fd, from, shortened("write", size, fd), at);
}

ssize_t pwrite64(int fd, const void* from, size_t size, off64_t at) { return pwrite(fd, from, size, at); }

int fsync(int fd) {
  static const auto real = next<int (*)(int)>("fsync");
  return fails("sync", fd) ? -1 : real(fd);
}

int fdatasync(int fd) {
  static const auto real = next<int (*)(int)>("fdatasync");
  return fails("sync", fd) ? -1 : real(fd);
}

int rename(const char* from, const char* to) {
  static const auto real = next<int (*)(const char*, const char*)>("rename");
  return fails("rename", to) ? -1 : real(from, to);
}

int renameat2(int from_at, const char* from, int to_at, const char* to, unsigned flags) {
  static const auto real = next<int (*)(int, const char*, int, const char*, unsigned)>("renameat2");
  return fails("rename", to) ? -1 : real(from_at, from, to_at, to, flags);
}

int linkat(int from_at, const char* from, int to_at, const char* to, int flags) {
  static const auto real = next<int (*)(int, const char*, int, const char*, int)>("linkat");
  return fails("rename", to) ? -1 : real(from_at, from, to_at, to, flags);
}

int open(const char* path, int flags, ...) {
  static const auto real = next<int (*)(const char*, int, ...)>("open");
  va_list rest;
  va_start(rest, flags);
  const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  const bool creates = (flags & O_CREAT) != 0 || (flags & O_TMPFILE) == O_TMPFILE;
  if (creates && fails("create", path)) return -1;
  return real(path, flags, mode);
}

int open64(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  return open(path, flags, mode);
}

}  // extern "C"
