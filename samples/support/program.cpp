#include "support/program.hpp"

#include <algorithm>
#include <cstdio>
#include <exception>

#include "apgm/core/error.hpp"

namespace apgm::samples {
namespace {

int exit_code(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidArgument:
      return 2;
    case ErrorCode::kUnreadable:
    case ErrorCode::kForeign:
    case ErrorCode::kDamaged:
    case ErrorCode::kUnsupported:
      return 4;
    case ErrorCode::kOutput:
      return 5;
    case ErrorCode::kLimit:
      return 6;
    case ErrorCode::kIncompatible:
      return 7;
    case ErrorCode::kCancelled:
      return 130;
  }
  return 70;
}

int fail(const std::string& name, int code, const std::string& message, const std::string& hint) {
  std::fprintf(stderr, "%s: error: %s\n", name.c_str(), message.c_str());
  if (!hint.empty()) std::fprintf(stderr, "hint: %s\n", hint.c_str());
  return code;
}

}  // namespace

int run_program(const std::string& name, const std::string& usage, int argc, char** argv,
                const std::function<void(std::vector<std::string>)>& body) {
  const std::vector<std::string> args(argv + std::min(argc, 1), argv + argc);
  const auto asked_for = [&](const char* flag) {
    return std::find(args.begin(), args.end(), flag) != args.end();
  };
  if (asked_for("-h") || asked_for("--help")) {
    std::fputs(usage.c_str(), stdout);
    return 0;
  }
  try {
    body(args);
    return 0;
  } catch (const UsageError& e) {
    return fail(name, 2, e.message, "'" + name + " --help' shows the usage");
  } catch (const Error& e) {
    return fail(name, exit_code(e.code()), e.message(), e.hint());
  } catch (const std::exception& e) {
    return fail(name, 70, e.what(), "this is a bug");
  }
}

std::string take_option(std::vector<std::string>& args, const std::string& flag) {
  const auto it = std::find(args.begin(), args.end(), flag);
  if (it == args.end()) return {};
  if (it + 1 == args.end() || (it + 1)->empty()) throw UsageError{"'" + flag + "' needs a value"};
  const std::string value = *(it + 1);
  args.erase(it, it + 2);
  return value;
}

bool take_switch(std::vector<std::string>& args, const std::string& flag) {
  return std::erase(args, flag) > 0;
}

std::uint64_t take_seed(std::vector<std::string>& args) {
  const std::string text = take_option(args, "--seed");
  if (text.empty()) return 1;
  if (text.find_first_not_of("0123456789") == std::string::npos && text.size() <= 18)
    return std::stoull(text);
  throw UsageError{"'" + text + "' is not a seed: use a whole number"};
}

void expect_arguments(const std::vector<std::string>& args, std::size_t count) {
  for (const auto& a : args) {
    if (a.size() > 1 && a[0] == '-') throw UsageError{"unknown option '" + a + "'"};
  }
  if (args.size() > count) throw UsageError{"unexpected argument '" + args[count] + "'"};
  if (args.size() < count) throw UsageError{"an argument is missing"};
}

}  // namespace apgm::samples
