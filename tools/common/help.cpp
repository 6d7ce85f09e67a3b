#include "tools/common/help.hpp"

#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <map>
#include <sstream>

#include "tools/common/exit_code.hpp"

namespace apgm::tools {
namespace {

constexpr std::size_t kWidth = 100;
constexpr std::size_t kNamesWidth = 34;

/// "-o, --output FILE"
std::string names_of(const CLI::Option& option) {
  std::string text;
  for (const std::string& name : option.get_snames()) text += (text.empty() ? "-" : ", -") + name;
  for (const std::string& name : option.get_lnames()) {
    text += (text.empty() ? "    --" : ", --") + name;
  }
  if (!option.get_type_name().empty()) text += " " + option.get_type_name();
  return text;
}

std::string option_lines(const CLI::Option& option) {
  const std::string names = "  " + names_of(option);
  const std::string meaning = wrap(option.get_description(), kWidth - kNamesWidth, kNamesWidth);
  if (names.size() + 2 > kNamesWidth) {
    return names + "\n" + std::string(kNamesWidth, ' ') + meaning + "\n";
  }
  return names + std::string(kNamesWidth - names.size(), ' ') + meaning + "\n";
}

std::string exit_code_lines(const ToolInfo& info) {
  std::map<int, std::string> codes{{kExitDone, "done"},
                                   {kExitUsage, "the command line cannot be used"},
                                   {kExitInput, "an input is missing, unreadable, damaged or unsupported"},
                                   {kExitBug, "a bug in the tool"},
                                   {kExitInterrupted, "interrupted; nothing was written"},
                                   {kExitPipe, "the reader of standard output went away"}};
  for (const auto& [code, meaning] : info.exit_codes) codes[code] = meaning;
  std::string text;
  for (const auto& [code, meaning] : codes) {
    text += fmt::format("  {:<4}{}\n", code, wrap(meaning, kWidth - 6, 6));
  }
  return text;
}

}  // namespace

std::string wrap(const std::string& text, std::size_t width, std::size_t indent) {
  std::istringstream words(text);
  std::string out, word;
  std::size_t column = 0;
  while (words >> word) {
    const std::size_t size = display_width(word);
    if (column > 0 && column + 1 + size > width) {
      out += "\n" + std::string(indent, ' ');
      column = 0;
    }
    out += (column > 0 ? " " : "") + word;
    column += size + (column > 0 ? 1 : 0);
  }
  return out;
}

std::string help_text(const ToolInfo& info, const CLI::App& app) {
  const std::string tool = info.verb == "apgm" ? info.verb : "apgm-" + info.verb;
  std::string text = fmt::format("{} - {}\n\nusage: {} {}\n", tool, info.summary, tool, info.usage);
  for (const std::string& paragraph : info.details) text += "\n" + wrap(paragraph, kWidth, 0) + "\n";
  std::vector<std::string> groups;
  for (const CLI::Option* option : app.get_options()) {
    if (std::find(groups.begin(), groups.end(), option->get_group()) == groups.end()) {
      groups.push_back(option->get_group());
    }
  }
  for (const std::string& group : groups) {
    text += "\n" + group + ":\n";
    for (const CLI::Option* option : app.get_options()) {
      if (option->get_group() == group) text += option_lines(*option);
    }
  }
  if (!info.examples.empty()) text += "\nExamples:\n";
  for (const ToolInfo::Example& example : info.examples) {
    text += "  " + example.command + "\n      " + wrap(example.meaning, kWidth - 6, 6) + "\n";
  }
  return text + "\nExit codes:\n" + exit_code_lines(info);
}

}  // namespace apgm::tools
