#pragma once

#include <atomic>

namespace apgm::tools {

/// SIGINT and SIGTERM set the flag and let the operation end by itself; a second signal, or three seconds
/// without an end (a pipe that nobody writes to), end the process. SIGPIPE and SIGXFSZ are ignored, so that
/// writing to a closed pipe or a file too large fails instead.
void handle_signals();

/// Standard streams that are closed are filled, so that no file that is opened takes their place.
void fill_standard_streams();

/// Set once a signal asked to stop.
const std::atomic<bool>& cancel_flag();

}  // namespace apgm::tools
