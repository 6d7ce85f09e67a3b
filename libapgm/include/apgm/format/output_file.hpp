#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace apgm {

struct OutputOptions {
  bool overwrite = false;  ///< replace an existing file
  bool fsync = false;      ///< flush to the disk before the file appears
};

/// A file that appears whole or not at all: written without a name beside its target (or under a temporary
/// one where the file system cannot do that), given its name by `commit`. Destroyed before: nothing is left,
/// an existing target is untouched. One that is replaced leaves its mode to the new file, and its owner and
/// group where the process may give them. "-" writes to standard output. Append-only.
class OutputFile {
 public:
  /// @throws Error{kOutput} if the target exists (without overwrite), is not a regular file, or cannot be
  /// written
  explicit OutputFile(const std::string& path, const OutputOptions& options = {});
  /// No file: what is written goes to the end of `bytes`, which outlives it, at the latest by `flush`.
  explicit OutputFile(std::vector<std::byte>& bytes);
  ~OutputFile();
  OutputFile(OutputFile&&) noexcept;
  OutputFile& operator=(OutputFile&&) noexcept;

  /// @throws Error{kOutput} on a full disk or any other failure
  void write(std::span<const std::byte> bytes);
  void write(const std::string& text);
  std::uint64_t size() const;
  /// Puts all that was written where it will stay, still without a name: what can fail on a full disk has
  /// failed then. With several outputs: flush all, then commit all. @throws Error{kOutput}
  void flush();
  /// Gives the file its name. @throws Error{kOutput}
  void commit();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// @throws Error{kInvalidArgument} if `output` names the same file as one of `inputs` (device and inode)
void check_not_an_input(const std::string& output, std::span<const std::string> inputs);

}  // namespace apgm
