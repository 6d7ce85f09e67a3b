#pragma once

namespace apgm {

/// Removes the temporary files of all outputs that are being written. For a signal handler that is about to
/// end the process, which then calls no destructors: async-signal-safe. The outputs must not be used
/// afterwards.
///
/// Most outputs have no such file: they are written without a name where the file system can do that.
void remove_temporary_files();

}  // namespace apgm
