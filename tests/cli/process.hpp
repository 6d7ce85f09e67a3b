#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <vector>

namespace apgm::test {

/// How a program is started; its standard output and error go to files unless said otherwise.
struct Launch {
  std::string directory = ".";           ///< working directory of the program
  std::string input;                     ///< path that becomes standard input; empty: /dev/null
  std::string output;                    ///< path that becomes standard output; empty: collected
  bool output_pipe_closed = false;       ///< standard output is a pipe nobody reads
  std::vector<std::string> environment;  ///< "NAME=VALUE", added to ours
};

struct Outcome {
  int code = -1;    ///< exit code; 128 + n if ended by signal n
  std::string out;  ///< standard output, where it was collected
  std::string err;  ///< standard error
};

/// A running program. The destructor ends it.
class Process {
 public:
  Process(const std::vector<std::string>& command, const Launch& launch = {});
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  void signal(int number) const;
  /// Waits until standard error holds `text`; false if the program ends or the time passes first.
  bool wait_for_error_text(const std::string& text, std::chrono::seconds limit);
  Outcome wait();

 private:
  bool ended();

  int pid_ = -1;
  int out_ = -1;
  int err_ = -1;
  int status_ = 0;
  bool reaped_ = false;
};

/// Starts a program and waits for it.
Outcome run(const std::vector<std::string>& command, const Launch& launch = {});

}  // namespace apgm::test
