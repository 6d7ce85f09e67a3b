#pragma once

#include <unistd.h>

#include <string>

namespace apgm::tools {

constexpr const char* kStreamExtension = ".apgms";

/// Closes a file descriptor at its end, but for the standard ones.
struct Descriptor {
  explicit Descriptor(int number) : fd(number) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() {
    if (fd > STDERR_FILENO) ::close(fd);
  }
  const int fd;
};

/// First bytes of an input, 4096 at most, by which its format is told. Standard input ("-") and other
/// pipes that somebody else holds open are left as they were; empty where that cannot be done.
/// @throws Error{kUnreadable}
std::string head_of(const std::string& path);

/// True if the bytes are those of this project's formats: a map, an archive or a stream.
bool is_apgm(const std::string& head);

/// True if an input is a stream: by its first bytes, or by its name if they are of no format of ours.
bool is_stream_input(const std::string& path, const std::string& head);

}  // namespace apgm::tools
