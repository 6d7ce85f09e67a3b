#include "tools/common/signals.hpp"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include "apgm/format/temporary_files.hpp"
#include "tools/common/exit_code.hpp"

namespace apgm::tools {
namespace {

std::atomic<bool> cancelled{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler sets it");

/// How long an operation may take to end by itself. Longer than any step of one; a wait for a pipe has no
/// end.
constexpr unsigned kGraceSeconds = 3;

void handle(int) {
  if (!cancelled.exchange(true)) {
    ::alarm(kGraceSeconds);
    return;
  }
  remove_temporary_files();
  ::_exit(kExitInterrupted);
}

}  // namespace

void fill_standard_streams() {
  for (int fd = 0; fd <= 2; ++fd) {
    if (::fcntl(fd, F_GETFD) != -1) continue;
    // The wrong direction on purpose: using a stream that was closed must fail.
    (void)::open("/dev/null", fd == 0 ? O_WRONLY : O_RDONLY);
  }
}

void handle_signals() {
  ::signal(SIGPIPE, SIG_IGN);
  ::signal(SIGXFSZ, SIG_IGN);
  struct sigaction action {};
  action.sa_handler = handle;
  action.sa_flags = SA_RESTART;
  ::sigaction(SIGINT, &action, nullptr);
  ::sigaction(SIGTERM, &action, nullptr);
  ::sigaction(SIGALRM, &action, nullptr);
}

const std::atomic<bool>& cancel_flag() { return cancelled; }

}  // namespace apgm::tools
