#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <climits>
#include <cstdlib>
#include <cstring>

#include "tools/common/app.hpp"
#include "tools/common/exit_code.hpp"
#include "tools/common/signals.hpp"
#include "tools/common/suggest.hpp"

namespace apgm::tools {
namespace {

struct Verb {
  const char* name;
  const char* summary;
};
constexpr std::array<Verb, 11> kVerbs{{{"info", "say what an .apgm map holds"},
                                       {"convert", "convert maps between .apgm and other formats"},
                                       {"merge", "fuse maps into one"},
                                       {"crop", "cut a region out of a map"},
                                       {"diff", "tell what differs between two maps"},
                                       {"resample", "bring a map to other cell sizes or another grid"},
                                       {"map", "make a map of laser scans and point clouds"},
                                       {"compare", "what a map or a drive costs in other layouts"},
                                       {"verify", "check an .apgm file, save what is whole of a damaged one"},
                                       {"archive", "keep the history of a map in one file"},
                                       {"render", "draw a map as a picture"}}};

std::string own_directory() {
  std::array<char, PATH_MAX> path;
  const ssize_t size = ::readlink("/proc/self/exe", path.data(), path.size());
  if (size <= 0) return {};
  const std::string self(path.data(), static_cast<std::size_t>(size));
  return self.substr(0, self.rfind('/'));
}

bool is_program(const std::string& path) {
  struct stat file {};
  return ::stat(path.c_str(), &file) == 0 && S_ISREG(file.st_mode) && ::access(path.c_str(), X_OK) == 0;
}

/// The program of a verb: beside this one, else in PATH; empty if there is none.
std::string program_of(const std::string& verb) {
  const std::string name = "apgm-" + verb;
  const std::string directory = own_directory();
  if (!directory.empty() && is_program(directory + "/" + name)) return directory + "/" + name;
  const char* variable = std::getenv("PATH");
  const std::string path = variable != nullptr ? variable : "";
  for (std::size_t from = 0; from < path.size();) {
    const std::size_t end = std::min(path.find(':', from), path.size());
    const std::string candidate = path.substr(from, end - from) + "/" + name;
    if (end > from && is_program(candidate)) return candidate;
    from = end + 1;
  }
  return {};
}

bool is_verb(const std::string& text) {
  return !text.empty() && text[0] != '-' && std::all_of(text.begin(), text.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-';
  });
}

std::string help() {
  std::string text =
      "apgm - work with adaptive patched grid maps\n\n"
      "usage: apgm VERB [OPTIONS] ...\n"
      "       apgm help VERB\n\nVerbs:\n";
  for (const Verb& verb : kVerbs) {
    if (!program_of(verb.name).empty()) text += fmt::format("  {:<12}{}\n", verb.name, verb.summary);
  }
  return text +
         "\nGeneral:\n"
         "  -h, --help                      print this help\n"
         "  -V, --version                   print the versions of the tool, the format and the libraries\n"
         "      --json                      print one JSON document on standard output, also on failure\n"
         "\n'apgm VERB ...' does the same as 'apgm-VERB ...'; 'apgm VERB --help' tells the options of one.\n";
}

[[noreturn]] void run_verb(const std::string& verb, std::vector<std::string> arguments) {
  const std::string program = is_verb(verb) ? program_of(verb) : "";
  if (program.empty()) {
    std::vector<std::string> names{"help"};
    for (const Verb& known : kVerbs) names.emplace_back(known.name);
    throw usage_error(fmt::format("unknown verb '{}'", verb),
                      did_you_mean(verb, names, "'apgm --help' lists the verbs"));
  }
  arguments.insert(arguments.begin(), "apgm-" + verb);
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  ::execv(program.c_str(), argv.data());
  throw Error(ErrorCode::kUnreadable, fmt::format("cannot run '{}': {}", program, std::strerror(errno)));
}

void front(Session& session, std::vector<std::string> arguments) {
  const auto print_help = [&] {
    session.print(help());
    session.result() = {{"help", help()}};
  };
  // Options before the verb: only those the front itself has.
  std::size_t at = 0;
  while (at < arguments.size() && arguments[at] == "--json") ++at;
  if (at == arguments.size()) return print_help();
  const std::string word = arguments[at];
  if (word == "-h" || word == "--help") return print_help();
  if (word == "-V" || word == "--version") return print_version(session);
  if (word == "help" && at + 1 == arguments.size()) return print_help();
  if (word == "help") run_verb(arguments[at + 1], {"--help"});
  if (word.starts_with("-")) {
    throw usage_error(fmt::format("unknown option '{}'", word),
                      did_you_mean(word, {"--help", "--version", "--json"},
                                   "options of a tool stand after the verb: apgm VERB OPTIONS"));
  }
  arguments.erase(arguments.begin() + static_cast<std::ptrdiff_t>(at));
  run_verb(word, std::move(arguments));
}

}  // namespace
}  // namespace apgm::tools

int main(int argc, char** argv) {
  using namespace apgm::tools;
  fill_standard_streams();
  Session session("apgm");
  const std::vector<std::string> arguments(argv + std::min(argc, 1), argv + argc);
  scan_arguments(session, arguments);
  return guarded(session, [&] { front(session, arguments); });
}
