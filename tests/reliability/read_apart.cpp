#include <fcntl.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <stdexcept>

#include "readers.hpp"

namespace apgm::test {
namespace {

constexpr int kPatience_ms = 10'000;
constexpr rlim_t kMaxMemory = rlim_t{2} << 30;

void limit(int resource, rlim_t value) {
  const rlimit bound{value, value};
  (void)::setrlimit(resource, &bound);
}

/// In the child: answers from file `from` on, one character each.
[[noreturn]] void answer(Format& format, std::size_t from, std::size_t n,
                         const std::function<std::string(std::size_t)>& make, int out) {
  limit(RLIMIT_AS, kMaxMemory);
  limit(RLIMIT_CORE, 0);
  const int null = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
  ::dup2(null, STDOUT_FILENO);
  ::dup2(null, STDERR_FILENO);
  for (std::size_t i = from; i < n; ++i) {
    char result = static_cast<char>(Answer::kDetected);
    try {
      result = static_cast<char>(format.read(make(i)));
    } catch (const std::exception&) {
      // An exception of the reader is a refusal.
    }
    if (::write(out, &result, 1) != 1) break;
  }
  ::_exit(0);
}

/// The answers of one child, up to its end.
std::string answers_of(int in, bool& hung) {
  std::string answers;
  hung = false;
  for (;;) {
    pollfd waiting{in, POLLIN, 0};
    if (::poll(&waiting, 1, kPatience_ms) == 0) {
      hung = true;
      return answers;
    }
    char buffer[4096];
    const ssize_t n = ::read(in, buffer, sizeof(buffer));
    if (n <= 0) return answers;
    answers.append(buffer, static_cast<std::size_t>(n));
  }
}

}  // namespace

std::string read_apart(Format& format, std::size_t n, const std::function<std::string(std::size_t)>& make) {
  std::string answers;
  while (answers.size() < n) {
    int ends[2];
    if (::pipe(ends) != 0) throw std::runtime_error("cannot make a pipe");
    const pid_t child = ::fork();
    if (child < 0) throw std::runtime_error("cannot start a process");
    if (child == 0) {
      ::close(ends[0]);
      answer(format, answers.size(), n, make, ends[1]);
    }
    ::close(ends[1]);
    bool hung = false;
    answers += answers_of(ends[0], hung);
    ::close(ends[0]);
    if (hung) ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    if (answers.size() < n) answers += static_cast<char>(hung ? Answer::kHang : Answer::kCrash);
  }
  return answers;
}

}  // namespace apgm::test
