#include "tools/common/input_head.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <span>

#include "apgm/core/error.hpp"
#include "apgm/format/stream.hpp"

namespace apgm::tools {
namespace {

constexpr std::size_t kHeadBytes = 4096;

/// First bytes of what cannot seek, if it is a pipe: a copy of what waits there.
ssize_t peek(int pipe_end, std::string& head) {
  int ends[2] = {-1, -1};
  if (::pipe(ends) != 0) return -1;
  const Descriptor out{ends[0]}, in{ends[1]};
  const ssize_t got = ::tee(pipe_end, in.fd, head.size(), 0);
  return got > 0 ? ::read(out.fd, head.data(), static_cast<std::size_t>(got)) : got;
}

/// As many bytes from `at` on as there are, up to the size of `head`.
ssize_t read_at(int fd, off_t at, std::string& head) {
  std::size_t done = 0;
  while (done < head.size()) {
    const ssize_t got = ::pread(fd, head.data() + done, head.size() - done, at + static_cast<off_t>(done));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return -1;
    if (got == 0) break;
    done += static_cast<std::size_t>(got);
  }
  return static_cast<ssize_t>(done);
}

}  // namespace

std::string head_of(const std::string& path) {
  const Descriptor input{path == "-" ? STDIN_FILENO : ::open(path.c_str(), O_RDONLY | O_CLOEXEC)};
  const off_t at = input.fd < 0 ? -1 : ::lseek(input.fd, 0, SEEK_CUR);
  std::string head(kHeadBytes, '\0');
  ssize_t got = -1;
  if (at >= 0) {
    got = read_at(input.fd, at, head);
  } else if (input.fd >= 0) {
    got = std::max<ssize_t>(peek(input.fd, head), 0);
  }
  if (got < 0 && path != "-") {
    const int error = errno;
    throw Error(ErrorCode::kUnreadable, fmt::format("cannot open '{}': {}", path, std::strerror(error)))
        .hint(error == ENOENT ? "check the name and the directory" : "")
        .at(path);
  }
  head.resize(static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
  return head;
}

bool is_apgm(const std::string& head) {
  constexpr std::string_view kMagic =
      "\x89"
      "APGM";
  return head.starts_with(kMagic);
}

bool is_stream_input(const std::string& path, const std::string& head) {
  if (is_apgm(head)) return is_stream(std::as_bytes(std::span(head)));
  return path.ends_with(kStreamExtension);
}

}  // namespace apgm::tools
