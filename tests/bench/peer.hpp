#pragma once

#include <array>
#include <chrono>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

namespace apgm::bench {

/// Wall seconds of one call.
template <typename Work>
double seconds_of(Work&& work) {
  const auto start = std::chrono::steady_clock::now();
  std::forward<Work>(work)();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Lines "NAME SECONDS SECONDS ...", as peers/measure.py reads them.
inline void print_timings(const char* name, const std::vector<double>& seconds) {
  std::printf("%s", name);
  for (const double s : seconds) std::printf(" %.9f", s);
  std::printf("\n");
}

/// Runs `work` once to warm up and `runs` times more, and prints the latter.
template <typename Work>
void time_runs(const char* name, int runs, Work&& work) {
  work();
  std::vector<double> seconds;
  for (int i = 0; i < runs; ++i) seconds.push_back(seconds_of(work));
  print_timings(name, seconds);
}

/// Takes `--runs N`, 1 to 1000; 5 if absent. @throws samples::UsageError
int take_runs(std::vector<std::string>& args);
/// XMIN,YMIN,XMAX,YMAX in metres. @throws samples::UsageError
std::array<double, 4> parse_box(const std::string& text);

}  // namespace apgm::bench
