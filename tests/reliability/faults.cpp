#include "faults.hpp"

#include <algorithm>

#include "random_map.hpp"

namespace apgm::test {
namespace {

/// `n` numbers of [0, total): all of them, or drawn without order.
std::vector<std::uint64_t> pick(std::uint64_t total, std::size_t most, std::string& choice) {
  std::vector<std::uint64_t> picked;
  if (total <= most) {
    choice = "all";
    for (std::uint64_t i = 0; i < total; ++i) picked.push_back(i);
    return picked;
  }
  choice = "drawn, seed 1";
  Random random(1);
  while (picked.size() < most) picked.push_back(random.next() % total);
  return picked;
}

FaultSet flips(const std::string& file, std::size_t most) {
  FaultSet set{"single-bit flips", {}, {}};
  for (const std::uint64_t bit : pick(file.size() * 8, most, set.choice)) {
    set.faults.push_back({Fault::Kind::kFlip, bit, 0, 0});
  }
  return set;
}

FaultSet truncations(const std::string& file, std::size_t most) {
  FaultSet set{"truncations", {}, {}};
  for (const std::uint64_t size : pick(file.size(), most, set.choice)) {
    set.faults.push_back({Fault::Kind::kTruncate, size, 0, 0});
  }
  return set;
}

FaultSet zeroed_runs(const std::string& file, std::uint64_t run, std::size_t most) {
  FaultSet set{"zeroed " + std::to_string(run) + " bytes", {}, {}};
  for (const std::uint64_t i : pick((file.size() + run - 1) / run, most, set.choice)) {
    set.faults.push_back({Fault::Kind::kZero, i * run, 0, std::min(run, file.size() - i * run)});
  }
  return set;
}

FaultSet swapped_runs(const std::string& file, std::uint64_t run, std::size_t most) {
  FaultSet set{"swapped " + std::to_string(run) + " bytes", {}, {}};
  const std::uint64_t n = file.size() / run;
  for (const std::uint64_t i : pick(n * n, most, set.choice)) {
    if (i / n < i % n) set.faults.push_back({Fault::Kind::kSwap, i / n * run, i % n * run, run});
  }
  return set;
}

}  // namespace

std::string with_fault(const std::string& file, const Fault& fault) {
  if (fault.kind == Fault::Kind::kTruncate) return file.substr(0, fault.a);
  std::string bad = file;
  switch (fault.kind) {
    case Fault::Kind::kFlip:
      bad[fault.a / 8] = static_cast<char>(bad[fault.a / 8] ^ (1 << (fault.a % 8)));
      break;
    case Fault::Kind::kZero:
      bad.replace(fault.a, fault.run, fault.run, '\0');
      break;
    default:
      std::swap_ranges(bad.begin() + static_cast<std::ptrdiff_t>(fault.a),
                       bad.begin() + static_cast<std::ptrdiff_t>(fault.a + fault.run),
                       bad.begin() + static_cast<std::ptrdiff_t>(fault.b));
  }
  return bad;
}

std::vector<FaultSet> faults_for(const std::string& file, std::size_t most) {
  const std::uint64_t run = file.size() < 8 * 4096 ? 64 : 4096;
  std::vector<FaultSet> sets{flips(file, most), truncations(file, most), zeroed_runs(file, run, most),
                             swapped_runs(file, run, most)};
  for (FaultSet& set : sets) {
    std::erase_if(set.faults, [&](const Fault& fault) { return with_fault(file, fault) == file; });
  }
  return sets;
}

}  // namespace apgm::test
