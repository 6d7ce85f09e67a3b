#pragma once

#include <string>
#include <utility>
#include <vector>

#include "tools/common/session.hpp"

namespace CLI {
class App;
}

namespace apgm::tools {

/// What --help says about a tool beside its options.
struct ToolInfo {
  struct Example {
    std::string command;
    std::string meaning;
  };
  std::string verb;                  ///< "crop"; the tool is apgm-crop
  std::string summary;               ///< one line, lower case: "cut a region out of a map"
  std::string usage;                 ///< after the tool's name: "[OPTIONS] INPUT -o OUTPUT"
  std::vector<std::string> details;  ///< paragraphs
  std::vector<Example> examples;
  std::vector<std::pair<int, std::string>> exit_codes;  ///< those of the tool beside 0, 2, 4, 70, 130, 141
};

/// One tool. `run_tool` calls the functions in their order.
class Tool {
 public:
  virtual ~Tool() = default;
  virtual ToolInfo info() const = 0;
  virtual void add_options(CLI::App& app) = 0;
  /// Checks all arguments, before a byte is read. @throws Error
  virtual void check(Session& session, const std::vector<std::string>& inputs) = 0;
  virtual void run(Session& session) = 0;
};

/// Runs a tool: parses, checks, runs; turns every failure into a message and an exit code of the frozen list.
/// @return the exit code of the process
int run_tool(Tool& tool, int argc, char** argv);

/// As run_tool's last step, for what is thrown by `body`: prints, and returns the exit code.
int guarded(Session& session, const std::function<void()>& body);

/// Sets --json, --color and -q from the raw arguments, so that errors in these look as asked for.
void scan_arguments(Session& session, const std::vector<std::string>& arguments);

/// Text and document of --version.
void print_version(Session& session);

/// Names of the foreign formats apgm-convert reads, for hints: "octomap, map_server".
std::string foreign_formats();

}  // namespace apgm::tools
