#include "tools/common/options.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <set>

#include "tools/common/exit_code.hpp"
#include "tools/common/memory.hpp"

namespace apgm::tools {
namespace {

constexpr const char* kOutputGroup = "Output";
constexpr const char* kMapGroup = "Writing .apgm";
constexpr const char* kWorkGroup = "Work";

std::string directory_of(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  if (slash == std::string::npos) return ".";
  return slash == 0 ? "/" : path.substr(0, slash);
}

Error output_error(const std::string& path, const std::string& message, const std::string& hint = {}) {
  Error error(ErrorCode::kOutput, message);
  error.hint(hint).at(path);
  return error;
}

}  // namespace

CLI::Option* add_text(CLI::App& app, const std::string& group, const std::string& names,
                      std::optional<std::string>& value, const std::string& type,
                      const std::string& meaning) {
  const auto take = [&value](const CLI::results_t& results) {
    value = results.back();
    return true;
  };
  return app.add_option(names, take, meaning)->group(group)->type_name(type);
}

CLI::Option* add_list(CLI::App& app, const std::string& group, const std::string& names,
                      std::vector<std::string>& values, const std::string& type, const std::string& meaning) {
  const auto take = [&values](const CLI::results_t& results) {
    values = results;
    return true;
  };
  return app.add_option(names, take, meaning)->group(group)->type_name(type)->take_all();
}

CLI::Option* add_switch(CLI::App& app, const std::string& group, const std::string& names, bool& value,
                        const std::string& meaning) {
  return app.add_flag(names, value, meaning)->group(group);
}

void OutputChoice::add(CLI::App& app) {
  add_text(app, kOutputGroup, "-o,--output", path_text_, "FILE",
           "where to write; '-' is standard output (required)");
  add_switch(app, kOutputGroup, "-O,--overwrite", overwrite, "replace an existing file");
  add_switch(app, kOutputGroup, "-n,--dry-run", dry_run,
             "check arguments and inputs, write nothing; losses found while writing are not foreseen");
  add_switch(app, kOutputGroup, "--fsync", fsync, "flush to the disk before the file appears");
}

void OutputChoice::check(Session& session, const std::vector<std::string>& inputs, bool binary) {
  if (!path_text_) {
    throw usage_error("no output is given", inputs.size() > 1
                                                ? "the output is named with -o: -o " + inputs.back()
                                                : "name the output with -o FILE");
  }
  path = *path_text_;
  if (path.empty()) throw usage_error("-o takes a file name, not an empty text");
  if (path == "-") {
    if (session.json) throw usage_error("--json and '-o -' both need standard output", "write to a file");
    if (binary && !dry_run && ::isatty(STDOUT_FILENO) == 1) {
      throw usage_error("binary data does not go to a terminal", "name a file with -o, or pipe the output");
    }
    session.stdout_is_output = true;
    return;
  }
  check_output_path(path, overwrite, inputs);
}

void check_output_path(const std::string& path, bool overwrite, const std::vector<std::string>& inputs) {
  check_not_an_input(path, inputs);
  struct stat file {};
  const bool there = ::stat(path.c_str(), &file) == 0;
  if (there) {
    if (S_ISDIR(file.st_mode)) {
      throw output_error(path, fmt::format("output '{}' is a directory", path), "name a file in it");
    }
    if (!S_ISREG(file.st_mode)) return;
    if (!overwrite) {
      throw output_error(path, fmt::format("output '{}' already exists", path),
                         "pass --overwrite to replace it");
    }
    if (::access(path.c_str(), W_OK) != 0) {
      throw output_error(path, fmt::format("cannot replace '{}': {}", path, std::strerror(errno)),
                         "name another output, or make the file writable");
    }
  }
  const std::string directory = directory_of(path);
  if (::stat(directory.c_str(), &file) != 0) {
    const bool missing = errno == ENOENT;
    throw output_error(
        path, fmt::format("cannot create '{}': directory '{}': {}", path, directory, std::strerror(errno)),
        missing ? fmt::format("create the directory '{}' first, or name another output", directory)
                : "name an output in another directory");
  }
  if (!S_ISDIR(file.st_mode)) {
    throw output_error(path, fmt::format("cannot create '{}': '{}' is not a directory", path, directory),
                       "name an output in another directory");
  }
  if (::access(directory.c_str(), W_OK) != 0) {
    throw output_error(path,
                       fmt::format("cannot {} '{}': directory '{}': {}", there ? "replace" : "create", path,
                                   directory, std::strerror(errno)),
                       there ? "the new file is written beside the old one first: name an output in a "
                               "directory you may write to"
                             : "name an output in a directory you may write to");
  }
}

void warn_of_extension(Session& session, const std::string& path, const std::string& written) {
  static const std::set<std::string> kForeign{
      ".apgm", ".apgms", ".bag",  ".bmp", ".bt",   ".csv", ".geojson", ".gif", ".jpeg", ".jpg",
      ".json", ".las",   ".mcap", ".npy", ".ot",   ".pcd", ".pdf",     ".pgm", ".ply",  ".png",
      ".svg",  ".tif",   ".tiff", ".txt", ".webp", ".xml", ".yaml",    ".yml", ".zip"};
  const std::string name = path.substr(path.rfind('/') + 1);
  const std::size_t dot = name.rfind('.');
  if (dot == std::string::npos || dot == 0) return;
  std::string extension;
  for (const char c : name.substr(dot)) {
    extension += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  if (extension == written || kForeign.count(extension) == 0) return;
  session.warning(fmt::format("'{}' gets {} content whatever its extension says", path, written));
}

void check_second_output(const std::string& option, const std::string& path, const OutputChoice& output,
                         const std::vector<std::string>& inputs) {
  if (path == "-") throw usage_error(option + " is not written to standard output", "name a file");
  // Either may not exist yet, so the places they would have are compared.
  const auto place = [](const std::string& p) {
    std::error_code error;
    const auto whole = std::filesystem::absolute(p, error);
    const auto resolved = std::filesystem::weakly_canonical(whole, error);
    return error ? whole : resolved;
  };
  if (same_file(path, output.path) || (output.path != "-" && place(path) == place(output.path))) {
    throw usage_error(fmt::format("{} and the output are the same file '{}'", option, path),
                      "name two files");
  }
  check_output_path(path, output.overwrite, inputs);
}

bool same_file(const std::string& a, const std::string& b) {
  if (a == b) return true;
  if (a == "-" || b == "-") return false;
  struct stat one {
  }, other{};
  if (::stat(a.c_str(), &one) != 0 || ::stat(b.c_str(), &other) != 0) return false;
  return one.st_dev == other.st_dev && one.st_ino == other.st_ino;
}

void MapWriting::add(CLI::App& app) {
  add_text(app, kMapGroup, "--level", level_text_, "1..19", "effort of the compression (default 3)");
  add_text(app, kMapGroup, "--lossy", lossy_text_, "u16|u8",
           "keep masses in steps of 1/65535 or 1/255 (default: every bit)");
  add_text(app, kMapGroup, "--stamp", stamp_text_, "TIME",
           fmt::format("store a time: {} (default: none)", kTimeForms));
  add_switch(app, kMapGroup, "--no-provenance", no_provenance, "write no history of how the map was made");
}

void MapWriting::check() {
  if (level_text_) {
    level = static_cast<int>(
        parse_integer("--level", *level_text_, 1, 19, "1 is the fastest, 19 the smallest; the default is 3"));
  }
  if (lossy_text_) {
    lossy = parse_choice("--lossy", *lossy_text_, {"u16", "u8"}) == "u8" ? Lossy::kU8 : Lossy::kU16;
  }
  if (stamp_text_) stamp_ns = parse_stamp("--stamp", *stamp_text_);
}

std::string MapWriting::given() const {
  if (level_text_) return "--level";
  if (lossy_text_) return "--lossy";
  if (stamp_text_) return "--stamp";
  return no_provenance ? "--no-provenance" : "";
}

WriterOptions MapWriting::options(const OutputChoice& output) const {
  WriterOptions options;
  options.output = output.options();
  options.level = level;
  options.lossy = lossy;
  return options;
}

void MapWriting::apply(MapHeader& header, const std::optional<Provenance>& step) const {
  if (stamp_ns) header.stamp_ns = *stamp_ns;
  if (step) header.history.push_back(*step);
  if (no_provenance) header.history.clear();
}

void Filter::add(CLI::App& app, bool with_box) {
  add_list(app, "Filter", "--layer", layers, "NAME", "only this layer (repeatable)");
  if (with_box) {
    add_text(app, "Filter", "--bbox", box_text_, "XMIN,YMIN,XMAX,YMAX",
             "only patches that share area with this box, in metres of the map's CRS");
  }
}

void Filter::check() {
  if (box_text_) box = parse_box("--bbox", *box_text_);
}

void HeavyOptions::add(CLI::App& app) {
  add_text(app, kWorkGroup, "-j,--threads", threads_text_, "N", "threads; 0: all cores (default)");
  add_text(app, kWorkGroup, "--max-memory", memory_text_, "SIZE",
           "bound of the memory used: 512M, 1.5GB; K, M, G, T are powers of 1024");
  CLI::Option* on = add_switch(app, kWorkGroup, "--progress", on_, "show progress, also without a terminal");
  add_switch(app, kWorkGroup, "--no-progress", off_, "show no progress")->excludes(on);
}

void HeavyOptions::check() {
  if (threads_text_) {
    threads = static_cast<int>(parse_integer("--threads", *threads_text_, 0, 1024,
                                             "0 takes all cores, 1 to 1024 is a number of threads"));
  }
  if (memory_text_) {
    max_memory_bytes = parse_size("--max-memory", *memory_text_);
    give_large_blocks_pages_of_their_own();
  }
  if (on_ || off_) progress = on_;
}

std::string one_input(const std::vector<std::string>& inputs) {
  check_inputs(inputs);
  if (inputs.size() > 1) {
    throw usage_error(fmt::format("unexpected argument '{}': one input is read", inputs[1]));
  }
  return inputs.front();
}

void check_inputs(const std::vector<std::string>& inputs) {
  if (inputs.empty()) throw usage_error("no input is given");
  if (std::count(inputs.begin(), inputs.end(), "-") > 1) {
    throw usage_error("standard input '-' is named twice");
  }
  if (std::find(inputs.begin(), inputs.end(), "") != inputs.end()) {
    throw usage_error("an input has an empty name");
  }
}

std::string parameters_text(const Json& parameters) { return to_line(parameters); }

Json box_json(const Box& box) { return {box.min.x_m, box.min.y_m, box.max.x_m, box.max.y_m}; }

}  // namespace apgm::tools
