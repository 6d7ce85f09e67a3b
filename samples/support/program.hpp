#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace apgm::samples {

/// A usage error: exit code 2.
struct UsageError {
  std::string message;
};

/// Runs `body` with the arguments after the program's name and returns its exit code by the rules of the
/// project's tools: 0 done, 2 usage, 4 input, 5 output, 6 limit, 7 incompatible, 70 bug. `-h` and `--help`
/// print `usage`. Errors go to stderr as "name: error: ...", with a hint where there is one.
int run_program(const std::string& name, const std::string& usage, int argc, char** argv,
                const std::function<void(std::vector<std::string>)>& body);

/// Takes `flag` and its value out of `args`. Empty if absent. @throws UsageError if the value is missing
std::string take_option(std::vector<std::string>& args, const std::string& flag);
/// Takes `flag` out of `args`: true if it was there.
bool take_switch(std::vector<std::string>& args, const std::string& flag);
/// Takes `--seed N`; 1 if absent. @throws UsageError unless a whole number of at most 18 digits
std::uint64_t take_seed(std::vector<std::string>& args);
/// @throws UsageError unless exactly `count` arguments, none looking like a flag, are left
void expect_arguments(const std::vector<std::string>& args, std::size_t count);

}  // namespace apgm::samples
