#pragma once

#include <benchmark/benchmark.h>
#include <time.h>

#include <algorithm>
#include <string>
#include <vector>

namespace apgm::bench {

/// CPU time of `work` on this thread alone: what others do on the machine does not count as long as they
/// leave the memory in peace.
double seconds(auto&& work) {
  const auto now = [] {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
  };
  const double begin = now();
  work();
  return now() - begin;
}

/// Of at least one value.
inline double median(std::vector<double> v) {
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
  return v[v.size() / 2];
}

/// Work and its peer, timed in turn: the median time of the work, of the peer, and of their ratios.
class Pairs {
 public:
  void add(double work_s, double peer_s) {
    work_.push_back(work_s);
    peer_.push_back(peer_s);
    ratio_.push_back(work_s / peer_s);
  }
  void report(benchmark::State& state, const char* peer) const {
    state.counters["work_us"] = median(work_) * 1e6;
    state.counters[std::string(peer) + "_us"] = median(peer_) * 1e6;
    state.counters["ratio"] = median(ratio_);
  }

 private:
  std::vector<double> work_, peer_, ratio_;
};

/// Runs both in each iteration of the benchmark and reports.
void in_turn(benchmark::State& state, const char* name, auto&& work, auto&& peer) {
  Pairs pairs;
  for (auto _ : state) {
    const double work_s = seconds([&] {
      work();
      benchmark::ClobberMemory();
    });
    const double peer_s = seconds([&] {
      peer();
      benchmark::ClobberMemory();
    });
    state.SetIterationTime(work_s);
    pairs.add(work_s, peer_s);
  }
  pairs.report(state, name);
}

}  // namespace apgm::bench
