#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "process.hpp"
#include "temp_dir.hpp"

namespace apgm::test {

/// A tool that writes, in a directory with inputs for all of them.
struct WriterCommand {
  std::string name;
  std::string verb;
  std::vector<std::string> arguments;  ///< with the outputs; each may be replaced
  std::vector<std::string> outputs;
  std::vector<std::string> inputs;
};
std::ostream& operator<<(std::ostream& out, const WriterCommand& command);

/// One command each tool and format.
const std::vector<WriterCommand>& writer_commands();

/// A directory with the inputs, and the outputs that each command makes of them.
class Workshop {
 public:
  /// @param patches_per_side  along each side of the maps; more make the commands run longer
  explicit Workshop(int patches_per_side);

  std::vector<std::string> line(const WriterCommand& command) const;
  Outcome run(const WriterCommand& command, const std::vector<std::string>& environment = {}) const;
  /// Runs the command once, undisturbed: what its outputs are to be.
  std::vector<std::string> expected(const WriterCommand& command) const;

  /// Puts an old file in the place of each output: one that the command may replace.
  void put_old(const WriterCommand& command) const;
  /// What the outputs hold; "" where there is none.
  std::vector<std::string> outputs(const WriterCommand& command) const;
  /// What `put_old` put there.
  std::vector<std::string> old(const WriterCommand& command) const;
  /// Names that are neither inputs nor outputs: what was left behind.
  std::vector<std::string> strangers(const WriterCommand& command) const;
  /// Names of all that is there.
  std::vector<std::string> names() const { return directory_.list(); }

  std::string path(const std::string& name) const { return directory_ / name; }
  std::string directory() const { return directory_.path(); }

 private:
  /// Removes all but the inputs.
  void clear() const;

  TempDir directory_;
  std::vector<std::string> inputs_;
};

/// Directory of the tools.
std::string tool_path(const std::string& verb);

}  // namespace apgm::test
