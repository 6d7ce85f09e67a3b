#include "apgm/format/output_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <utility>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/format/temporary_files.hpp"

namespace apgm {
namespace {

constexpr std::size_t kBufferBytes = std::size_t{1} << 18;

[[noreturn]] void fail(const std::string& path, const std::string& what, int error) {
  Error e(ErrorCode::kOutput, "cannot " + what + " '" + path + "': " + std::strerror(error));
  e.at(path);
  if (error == ENOSPC || error == EDQUOT)
    e.hint("free some space or choose another place; nothing was written");
  if (error == EFBIG)
    e.hint("raise the limit of file sizes of this process ('ulimit -f'), or choose another file system");
  throw e;
}

std::string directory_of(const std::string& path) {
  const auto slash = path.rfind('/');
  if (slash == std::string::npos) return ".";
  return slash == 0 ? "/" : path.substr(0, slash);
}

/// Of a file that is not there yet: what is refused may be the directory's, not that of the file it replaces.
[[noreturn]] void fail_to_create(const std::string& path, const std::string& target, int error) {
  if (error != EACCES && error != EPERM && error != EROFS) fail(path, "create", error);
  throw Error(ErrorCode::kOutput, "cannot make a temporary file beside '" + path + "', in directory '" +
                                      directory_of(target) + "': " + std::strerror(error))
      .hint(
          "a file is written beside its place first, also where it replaces another: you must be allowed to "
          "write to the directory")
      .at(path);
}

struct TemporaryName {
  static constexpr std::size_t kMostBytes = 4096;
  std::atomic<bool> taken{false}, named{false};
  std::array<char, kMostBytes> name{};
};

/// Names of the files that a signal handler would have to remove. Where there are more, or longer ones, than
/// places for them, the process is not to be ended by a handler at that moment.
class TemporaryNames {
 public:
  /// @return the place; nullopt: none is free
  static std::optional<std::size_t> add(const std::string& name) {
    if (name.size() >= TemporaryName::kMostBytes) return {};
    for (std::size_t i = 0; i < places_.size(); ++i) {
      if (places_[i].taken.exchange(true)) continue;
      std::memcpy(places_[i].name.data(), name.c_str(), name.size() + 1);
      places_[i].named.store(true, std::memory_order_release);
      return i;
    }
    return {};
  }
  static void drop(std::optional<std::size_t>& place) {
    if (!place) return;
    places_[*place].named.store(false, std::memory_order_release);
    places_[*place].taken.store(false, std::memory_order_release);
    place.reset();
  }
  static void remove_all() {
    for (const TemporaryName& place : places_) {
      if (place.named.load(std::memory_order_acquire)) ::unlink(place.name.data());
    }
  }

 private:
  static inline std::array<TemporaryName, 8> places_;
};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler reads them");

/// A link is followed, so that the file it names is replaced or made, not the link.
std::string resolve_link(std::string path) {
  constexpr int kMostLinks = 40;  // as the kernel
  for (int i = 0; i < kMostLinks; ++i) {
    std::string to(4096, '\0');
    const ssize_t size = ::readlink(path.c_str(), to.data(), to.size());
    if (size < 0) return path;
    to.resize(static_cast<std::size_t>(size));
    path = to[0] == '/' ? to : directory_of(path) + "/" + to;
  }
  fail(path, "follow the links of", ELOOP);
}

}  // namespace

struct OutputFile::State {
  std::string path;                  // as the caller named it
  std::string target;                // after links
  std::string temporary;             // name of the file while it has one
  std::optional<std::size_t> place;  // of that name in TemporaryNames
  OutputOptions options;
  int fd = -1;
  bool is_stdout = false;
  bool is_device = false;
  std::vector<std::byte>* memory = nullptr;
  std::uint64_t size = 0;
  std::vector<std::byte> buffer;
  bool settled = false;  // nothing was written since the disk was asked to keep it

  ~State() {
    if (fd >= 0 && !is_stdout) ::close(fd);
    if (!temporary.empty()) ::unlink(temporary.c_str());
    TemporaryNames::drop(place);
  }

  void write_out(const std::byte* data, std::size_t bytes) {
    if (memory != nullptr) {
      memory->insert(memory->end(), data, data + bytes);
      return;
    }
    while (bytes > 0) {
      const ssize_t n = ::write(fd, data, bytes);
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) fail(path, "write", errno);
      data += n;
      bytes -= static_cast<std::size_t>(n);
    }
  }

  void flush() {
    write_out(buffer.data(), buffer.size());
    buffer.clear();
  }

  /// All that can fail for want of space or by a disk's fault, before anything gets its name.
  void settle() {
    if (!buffer.empty()) settled = false;
    flush();
    if (settled || !options.fsync || is_stdout || is_device || memory != nullptr) return;
    if (::fsync(fd) != 0) fail(path, "flush", errno);
    settled = true;
  }

  /// A name beside the target that nothing has; tried in turn, so that no clock or random number is needed.
  template <typename Try>
  std::string beside(Try attempt) {
    for (int i = 0; i < 10'000; ++i) {
      std::string name = target + ".part" + std::to_string(::getpid()) + "-" + std::to_string(i);
      place = TemporaryNames::add(name);  // before there is a file: no moment may be missed
      if (attempt(name)) return name;
      const int error = errno;
      TemporaryNames::drop(place);
      if (error != EEXIST) fail_to_create(path, target, error);
    }
    fail(path, "create", EEXIST);
  }

  void open() {
    // A file without a name leaves nothing behind, not even when the process is killed.
    fd = ::open(directory_of(target).c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0666);
    if (fd >= 0 && ::access(self_path().c_str(), F_OK) == 0) return;
    if (fd >= 0)
      ::close(std::exchange(fd, -1));  // without /proc it could never be given a name
    else if (errno != EOPNOTSUPP && errno != EISDIR && errno != EINVAL)
      fail_to_create(path, target, errno);
    temporary = beside([&](const std::string& name) {
      fd = ::open(name.c_str(), O_CREAT | O_EXCL | O_RDWR | O_CLOEXEC, 0666);
      return fd >= 0;
    });
  }

  /// Gives a named file its final name, atomically, replacing nothing unless asked to.
  void rename_to_target(const std::string& from, bool replace) {
    if (replace) {
      if (::rename(from.c_str(), target.c_str()) != 0) fail(path, "replace", errno);
    } else if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, target.c_str(), RENAME_NOREPLACE) != 0) {
      if (errno != EINVAL && errno != ENOSYS) fail(path, "create", errno);
      // A file system without that flag: it was checked just before that nothing is there.
      if (::rename(from.c_str(), target.c_str()) != 0) fail(path, "create", errno);
    }
    temporary.clear();
    TemporaryNames::drop(place);
  }

  void commit() {
    settle();
    if (is_stdout || is_device || memory != nullptr) return;
    const bool replace = ::access(target.c_str(), F_OK) == 0;
    if (replace && !options.overwrite) fail(path, "create", EEXIST);
    if (replace) keep_owner_and_mode();
    if (temporary.empty()) {
      const std::string self = self_path();
      const auto link_to = [&](const std::string& name) {
        return ::linkat(AT_FDCWD, self.c_str(), AT_FDCWD, name.c_str(), AT_SYMLINK_FOLLOW) == 0;
      };
      if (replace) {
        temporary = beside(link_to);
      } else if (!link_to(target)) {
        fail(path, "create", errno);
      }
    }
    // Network file systems tell of a full disk at close: before the old file is gone.
    if (::close(std::exchange(fd, -1)) != 0) {
      const int error = errno;
      if (temporary.empty()) ::unlink(target.c_str());  // it was not there before, and is not whole
      fail(path, "write", error);
    }
    if (!temporary.empty()) rename_to_target(temporary, replace);
    if (options.fsync) sync_directory();
  }

  std::string self_path() const { return "/proc/self/fd/" + std::to_string(fd); }

  /// A replaced file keeps its owner and group, where the process may give them, and its permissions; but who
  /// did not own it before does not get what runs with the owner's rights.
  void keep_owner_and_mode() const {
    struct stat old {
    }, mine{};
    // Not through a link: `target` was none when it was opened, and one made since names a stranger's file.
    if (::lstat(target.c_str(), &old) != 0 || !S_ISREG(old.st_mode) || ::fstat(fd, &mine) != 0) return;
    if (old.st_uid != mine.st_uid || old.st_gid != mine.st_gid) {
      // A group alone may be given by any owner that is in it.
      if (::fchown(fd, old.st_uid, old.st_gid) != 0) (void)::fchown(fd, static_cast<uid_t>(-1), old.st_gid);
      if (::fstat(fd, &mine) != 0) return;
    }
    mode_t mode = old.st_mode & 07777;
    if (old.st_uid != mine.st_uid) mode &= ~static_cast<mode_t>(S_ISUID);
    if (old.st_gid != mine.st_gid) mode &= ~static_cast<mode_t>(S_ISGID);
    (void)::fchmod(fd, mode);  // last: a change of owner takes these bits away
  }

  void sync_directory() const {
    const int dir = ::open(directory_of(target).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (dir < 0) return;
    (void)::fsync(dir);
    ::close(dir);
  }
};

OutputFile::OutputFile(const std::string& path, const OutputOptions& options)
    : state_(std::make_unique<State>()) {
  state_->path = path;
  state_->options = options;
  state_->buffer.reserve(kBufferBytes);
  if (path == "-") {
    state_->is_stdout = true;
    state_->fd = STDOUT_FILENO;
    return;
  }
  state_->target = resolve_link(path);
  struct stat st {};
  if (::stat(path.c_str(), &st) == 0) {
    if (S_ISDIR(st.st_mode)) fail(path, "write", EISDIR);
    if (!S_ISREG(st.st_mode)) {  // a pipe or a device is written as it is
      state_->is_device = true;
      state_->fd = ::open(path.c_str(), O_WRONLY | O_CLOEXEC);
      if (state_->fd < 0) fail(path, "write", errno);
      return;
    }
    if (!options.overwrite) {
      throw Error(ErrorCode::kOutput, "output '" + path + "' already exists")
          .hint("pass --overwrite to replace it")
          .at(path);
    }
    if (::access(path.c_str(), W_OK) != 0) fail(path, "replace", errno);
  }
  state_->open();
}

OutputFile::OutputFile(std::vector<std::byte>& bytes) : state_(std::make_unique<State>()) {
  state_->memory = &bytes;
}

OutputFile::~OutputFile() = default;
OutputFile::OutputFile(OutputFile&&) noexcept = default;
OutputFile& OutputFile::operator=(OutputFile&&) noexcept = default;

void OutputFile::write(std::span<const std::byte> bytes) {
  State& s = *state_;
  s.size += bytes.size();
  s.settled = false;
  if (s.buffer.size() + bytes.size() > kBufferBytes) s.flush();
  if (bytes.size() >= kBufferBytes) {
    s.write_out(bytes.data(), bytes.size());
  } else {
    s.buffer.insert(s.buffer.end(), bytes.begin(), bytes.end());
  }
}

void OutputFile::write(const std::string& text) { write(std::as_bytes(std::span(text))); }

std::uint64_t OutputFile::size() const { return state_->size; }

void OutputFile::flush() { state_->settle(); }

void OutputFile::commit() { state_->commit(); }

void remove_temporary_files() { TemporaryNames::remove_all(); }

void check_not_an_input(const std::string& output, std::span<const std::string> inputs) {
  struct stat out {};
  if (output == "-" || ::stat(output.c_str(), &out) != 0) return;
  for (const std::string& input : inputs) {
    struct stat in {};
    if (input == "-" || ::stat(input.c_str(), &in) != 0) continue;
    if (S_ISREG(out.st_mode) && in.st_dev == out.st_dev && in.st_ino == out.st_ino) {
      throw Error(ErrorCode::kInvalidArgument, "output '" + output + "' is the input '" + input + "'")
          .hint("write to another file, then rename it");
    }
  }
}

}  // namespace apgm
