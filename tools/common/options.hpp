#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "apgm/core/frame.hpp"
#include "apgm/core/source.hpp"
#include "apgm/format/writer.hpp"
#include "tools/common/parse.hpp"
#include "tools/common/session.hpp"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace apgm::tools {

// Declaring options. Values stay text until `check`, so that every message about them is ours.

/// An option with one value. @param names as CLI11 wants them: "-o,--output"
CLI::Option* add_text(CLI::App& app, const std::string& group, const std::string& names,
                      std::optional<std::string>& value, const std::string& type, const std::string& meaning);
/// An option that may be repeated.
CLI::Option* add_list(CLI::App& app, const std::string& group, const std::string& names,
                      std::vector<std::string>& values, const std::string& type, const std::string& meaning);
CLI::Option* add_switch(CLI::App& app, const std::string& group, const std::string& names, bool& value,
                        const std::string& meaning);

/// -o, -O, -n, --fsync: where a writer writes.
struct OutputChoice {
  std::string path;
  bool overwrite = false;
  bool dry_run = false;
  bool fsync = false;

  void add(CLI::App& app);
  /// Before anything is read: a path is given, it is none of `inputs`, it can be written.
  /// @param binary  refuse a terminal
  /// @throws Error{kInvalidArgument|kOutput}
  void check(Session& session, const std::vector<std::string>& inputs, bool binary = true);
  /// Any of them is on the command line, for tools that do not always write.
  bool given() const { return path_text_ || overwrite || dry_run || fsync; }
  OutputOptions options() const { return {overwrite, fsync}; }

 private:
  std::optional<std::string> path_text_;
};

/// Warns where the extension of an output names a format other than what is written, ".apgm" or ".png".
void warn_of_extension(Session& session, const std::string& path, const std::string& written);

/// Both name one file: equal texts, or device and inode. Standard input is itself only.
bool same_file(const std::string& a, const std::string& b);

/// The check of OutputChoice for another path.
void check_output_path(const std::string& path, bool overwrite, const std::vector<std::string>& inputs);
/// The same for a second output, such as a picture, that `option` names: a file, and not the first output.
void check_second_output(const std::string& option, const std::string& path, const OutputChoice& output,
                         const std::vector<std::string>& inputs);

/// --level, --lossy, --stamp, --no-provenance: how an .apgm file is written.
struct MapWriting {
  int level = 3;
  Lossy lossy = Lossy::kNone;
  std::optional<std::int64_t> stamp_ns;
  bool no_provenance = false;

  void add(CLI::App& app);
  void check();
  /// Option that was given, for tools that may write other formats; empty: none.
  std::string given() const;
  /// A level or a lossy encoding was asked for.
  bool reencode() const { return level_text_ || lossy_text_; }
  WriterOptions options(const OutputChoice& output) const;
  /// Sets the stamp, appends `step` unless it is empty, clears the history if asked to.
  void apply(MapHeader& header, const std::optional<Provenance>& step) const;

 private:
  std::optional<std::string> level_text_, lossy_text_, stamp_text_;
};

/// --layer, --bbox: what part of an input is looked at.
struct Filter {
  std::vector<std::string> layers;
  std::optional<Box> box;

  void add(CLI::App& app, bool with_box = true);
  void check();
  bool any() const { return !layers.empty() || box.has_value(); }

 private:
  std::optional<std::string> box_text_;
};

/// -j, --max-memory, --progress: how long work runs.
struct HeavyOptions {
  int threads = 0;
  std::uint64_t max_memory_bytes = 0;
  std::optional<bool> progress;

  void add(CLI::App& app);
  void check();

 private:
  std::optional<std::string> threads_text_, memory_text_;
  bool on_ = false, off_ = false;
};

/// The one input of a tool that takes one. @throws Error{kInvalidArgument} for none or more
std::string one_input(const std::vector<std::string>& inputs);
/// @throws Error{kInvalidArgument} if there is none, or standard input is named twice
void check_inputs(const std::vector<std::string>& inputs);

/// JSON of the parameters of a step, as kept in the history: one line.
std::string parameters_text(const Json& parameters);
Json box_json(const Box& box);

}  // namespace apgm::tools
