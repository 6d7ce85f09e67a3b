#include "tools/common/app.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>  // all of it: here the classes CLI11 derives get their tables
#include <algorithm>
#include <new>

#include "apgm/format/version.hpp"
#include "tools/common/exit_code.hpp"
#include "tools/common/help.hpp"
#include "tools/common/options.hpp"
#include "tools/common/signals.hpp"
#include "tools/common/suggest.hpp"

namespace apgm::tools {
namespace {

constexpr const char* kGeneralGroup = "General";

struct GeneralOptions {
  bool help = false;
  bool version = false;
  std::optional<std::string> color;

  void add(CLI::App& app, Session& session) {
    add_switch(app, kGeneralGroup, "--json", session.json,
               "print one JSON document on standard output, also on failure");
    add_switch(app, kGeneralGroup, "-q,--quiet", session.quiet, "print errors only");
    add_switch(app, kGeneralGroup, "-v,--verbose", session.verbose, "print steps, sizes and peak memory");
    add_text(app, kGeneralGroup, "--color", color, "auto|always|never",
             "color messages (default: on a terminal, unless NO_COLOR is set)");
    add_switch(app, kGeneralGroup, "-h,--help", help, "print this help");
    add_switch(app, kGeneralGroup, "-V,--version", version,
               "print the versions of tool, format, zstd and FlatBuffers");
  }
};

std::vector<std::string> option_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_snames()) names.push_back("-" + name);
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

bool looks_like_option(const std::string& text) { return text.size() > 1 && text[0] == '-'; }

bool looks_negative(const std::string& text) {
  return text.size() > 1 && text[0] == '-' &&
         text.find_first_not_of("0123456789.,eE-", 1) == std::string::npos &&
         text.find_first_of("0123456789") <= 2;
}

/// The text of CLI11's complaints, in our words.
Error usage_error_from(const CLI::ParseError& error, const std::vector<std::string>& arguments) {
  const std::string text = error.what();
  const std::size_t colon = text.find(": ");
  if (error.get_name() == "ArgumentMismatch" && colon != std::string::npos) {
    // "-o,--output: 1 required FILE missing", "--level: At Most 1 required but received 2"
    const std::string name = text.substr(0, colon);
    if (text.ends_with("missing")) return usage_error(fmt::format("{} needs a value", name));
    if (text.find("At Most") != std::string::npos) return usage_error(fmt::format("{} is given twice", name));
  }
  if (error.get_name() == "ExcludesError") {
    const std::size_t verb = text.find(" excludes ");
    if (verb != std::string::npos) {
      return usage_error(
          fmt::format("{} and {} exclude each other", text.substr(0, verb), text.substr(verb + 10)));
    }
  }
  return usage_error(fmt::format("the command line cannot be read: {}", text),
                     arguments.empty() ? "" : "see --help");
}

/// `--output= x` would take x: CLI11 treats an empty value as none.
void refuse_empty_values(const std::vector<std::string>& arguments) {
  for (const std::string& argument : arguments) {
    if (argument == "--") return;
    if (argument.starts_with("--") && argument.find('=') == argument.size() - 1) {
      throw usage_error(fmt::format("{} needs a value", argument.substr(0, argument.size() - 1)));
    }
  }
}

/// `-o -n` would write a file named -n: a value that is an option is a forgotten value.
void refuse_swallowed_options(const CLI::App& app) {
  const std::vector<std::string> names = option_names(app);
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_items_expected_max() == 0) continue;
    for (const std::string& value : option->results()) {
      if (std::find(names.begin(), names.end(), value) == names.end()) continue;
      throw usage_error(fmt::format("{} needs a value, but is followed by {}", option->get_name(), value),
                        fmt::format("write ./{} for a file of this name", value));
    }
  }
}

/// What CLI11 did not take: inputs, and options nobody knows.
std::vector<std::string> inputs_of(const CLI::App& app) {
  std::vector<std::string> inputs;
  bool options_ended = false;
  for (const std::string& argument : app.remaining()) {
    if (!options_ended && argument == "--") {
      options_ended = true;
    } else if (!options_ended && looks_like_option(argument)) {
      const std::string name = argument.substr(0, argument.find('='));
      const char* negative = "a number below 0 is only taken as the value of an option";
      throw usage_error(fmt::format("unknown option '{}'", name),
                        looks_negative(name)
                            ? negative
                            : did_you_mean(name, option_names(app), "--help lists the options"));
    } else {
      inputs.push_back(argument);
    }
  }
  return inputs;
}

std::vector<std::string> arguments_of(int argc, char** argv) {
  return argc > 1 ? std::vector<std::string>(argv + 1, argv + argc) : std::vector<std::string>();
}

void parse(CLI::App& app, const std::vector<std::string>& arguments) {
  refuse_empty_values(arguments);
  try {
    app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  } catch (const CLI::ParseError& error) {
    throw usage_error_from(error, arguments);
  }
  refuse_swallowed_options(app);
}

std::string hint_for(const Session& session, const Error& error) {
  if (const std::string hint = session.memory_hint(error); !hint.empty()) return hint;
  if (!error.hint().empty()) return error.hint();
  if (error.code() == ErrorCode::kForeign) return "apgm-convert reads: " + foreign_formats();
  return {};
}

std::string message_for(const Error& error) {
  if (error.code() == ErrorCode::kCancelled) return "interrupted";
  if (error.path().empty() || error.message().find(error.path()) != std::string::npos) return error.message();
  return fmt::format("'{}': {}", error.path(), error.message());
}

int fail(Session& session, const Error& error) {
  const bool pipe = error.code() == ErrorCode::kOutput && session.stdout_is_output && stdout_is_broken();
  if (pipe) return kExitPipe;
  session.fail(to_string(error.code()), message_for(error), hint_for(session, error), error.path(),
               error.offset_bytes());
  return exit_code(error.code());
}

}  // namespace

std::string foreign_formats() { return "octomap, map_server, geotiff, numpy"; }

void scan_arguments(Session& session, const std::vector<std::string>& arguments) {
  const auto color_from = [&](const std::string& text) {
    if (text == "always") session.color = Color::kAlways;
    if (text == "never") session.color = Color::kNever;
  };
  for (std::size_t i = 0; i < arguments.size() && arguments[i] != "--"; ++i) {
    const std::string& argument = arguments[i];
    if (argument == "--json") session.json = true;
    if (argument.starts_with("--color=")) color_from(argument.substr(8));
    if (argument == "--color" && i + 1 < arguments.size()) color_from(arguments[i + 1]);
  }
}

void print_version(Session& session) {
  const Versions v = versions();
  session.print(fmt::format("{} {} (format {}, archives {}, zstd {}, FlatBuffers {})\n", session.tool(),
                            v.library, v.format, v.archive_format, v.zstd, v.flatbuffers));
  session.result() = {{"tool", session.tool()},     {"version", v.library},
                      {"format_version", v.format}, {"archive_format_version", v.archive_format},
                      {"zstd_version", v.zstd},     {"flatbuffers_version", v.flatbuffers}};
}

int guarded(Session& session, const std::function<void()>& body) {
  int code = kExitBug;
  try {
    body();
    return session.finish();
  } catch (const Error& error) {
    code = fail(session, error);
  } catch (const AnswerNo& no) {
    session.fail("no", no.message(), no.hint());
    code = kExitNo;
  } catch (const std::bad_alloc&) {
    session.fail("limit", "out of memory", "lower --max-memory or the number of threads");
    code = kExitLimit;
  } catch (const std::exception& error) {
    session.fail("bug", error.what(), "this is a bug in " + session.tool() + "; please report it");
  } catch (...) {
    session.fail("bug", "an unknown failure", "this is a bug in " + session.tool() + "; please report it");
  }
  if (session.json && code != kExitPipe) session.flush_output();
  return code;
}

int run_tool(Tool& tool, int argc, char** argv) {
  fill_standard_streams();
  handle_signals();
  const std::vector<std::string> arguments = arguments_of(argc, argv);
  const ToolInfo info = tool.info();
  Session session(info.verb);
  scan_arguments(session, arguments);
  return guarded(session, [&] {
    CLI::App app;
    app.set_help_flag();
    app.allow_extras();
    GeneralOptions general;
    tool.add_options(app);
    general.add(app, session);
    parse(app, arguments);
    if (general.help) {
      const std::string text = help_text(info, app);
      session.print(text);
      session.result() = {{"help", text}};
      return;
    }
    if (general.version) return print_version(session);
    const std::vector<std::string> inputs = inputs_of(app);
    if (general.color) parse_choice("--color", *general.color, {"auto", "always", "never"});
    if (session.quiet && session.verbose) throw usage_error("-q and -v exclude each other");
    tool.check(session, inputs);
    tool.run(session);
  });
}

}  // namespace apgm::tools
