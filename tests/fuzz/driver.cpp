// Plays seeds, and mutations of them, into a fuzz target where there is no libFuzzer: with any compiler, in
// every run of the tests. The same mutations in every run.
//
//   fuzz_NAME [-seconds=S] [-runs=N] [-seed=K] FILE_OR_DIR...
//
// Ends early when S seconds of its own time are over. An input that crashes is left in the working directory.

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <string>

#include "fuzz.hpp"
#include "random_map.hpp"

extern "C" {
// Both are there or not: the first in targets that bring their own, the second under sanitizers.
__attribute__((weak)) std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                                          std::size_t max_size, unsigned seed);
__attribute__((weak)) void __sanitizer_set_death_callback(void (*callback)());
}

namespace {

namespace fs = std::filesystem;
using apgm::test::Random;

constexpr std::size_t kMostBytes = std::size_t{64} << 10;
constexpr double kMostSeconds = 10;                                   // of one input
constexpr long kMostKiB = APGM_FUZZ_SANITIZED ? 2 << 20 : 512 << 10;  // resident, of the process

Random mutations(1);
std::string input;
std::string find_name;

struct Options {
  double seconds = 2;
  std::uint64_t runs = 100'000;
  std::uint64_t seed = 1;
  std::vector<std::string> paths;
};

void save_input() {
  const int file = ::open(find_name.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file < 0) return;
  const ssize_t n = ::write(file, input.data(), input.size());
  ::close(file);
  std::fprintf(stderr, "fuzz: the input is in %s (%zd bytes)\n", find_name.c_str(), n);
}

extern "C" void on_crash(int number) {
  save_input();
  ::signal(number, SIG_DFL);
  ::raise(number);
}

void catch_crashes() {
  if (__sanitizer_set_death_callback != nullptr) {
    __sanitizer_set_death_callback(save_input);
    ::signal(SIGABRT, on_crash);
    return;
  }
  for (const int number : {SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGILL}) ::signal(number, on_crash);
}

double cpu_seconds() {
  std::timespec t{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_nsec) * 1e-9;
}

long peak_kib() {
  struct rusage usage {};
  ::getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

void run_input() {
  const double start = cpu_seconds();
  LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(input.data()), input.size());
  const double took = cpu_seconds() - start;
  if (took > kMostSeconds) apgm::fuzz::fail("an input took " + std::to_string(took) + " s");
  if (peak_kib() > kMostKiB) apgm::fuzz::fail("memory reached " + std::to_string(peak_kib()) + " KiB");
}

Options parse(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string arg = argv[i];
    const auto value = [&](const char* key) {
      return arg.starts_with(key) ? arg.c_str() + std::strlen(key) : nullptr;
    };
    if (const char* seconds = value("-seconds=")) {
      options.seconds = std::atof(seconds);
    } else if (const char* runs = value("-runs=")) {
      options.runs = std::strtoull(runs, nullptr, 10);
    } else if (const char* seed = value("-seed=")) {
      options.seed = std::strtoull(seed, nullptr, 10);
    } else {
      options.paths.push_back(arg);
    }
  }
  return options;
}

std::vector<std::string> read_seeds(const std::vector<std::string>& paths) {
  std::vector<std::string> files;
  for (const std::string& path : paths) {
    if (!fs::is_directory(path)) {
      files.push_back(path);
      continue;
    }
    for (const auto& entry : fs::directory_iterator(path)) {
      if (entry.is_regular_file()) files.push_back(entry.path().string());
    }
  }
  std::ranges::sort(files);
  std::vector<std::string> seeds;
  for (const std::string& file : files) seeds.push_back(apgm::test::read_file(file));
  return seeds;
}

void mutate_input() {
  const std::size_t size = std::min(input.size(), kMostBytes);
  input.resize(kMostBytes);
  auto* data = reinterpret_cast<std::uint8_t*>(input.data());
  const std::size_t n =
      LLVMFuzzerCustomMutator != nullptr
          ? LLVMFuzzerCustomMutator(data, size, kMostBytes, static_cast<unsigned>(mutations.next()))
          : LLVMFuzzerMutate(data, size, kMostBytes);
  input.resize(n);
}

/// Overwrites 1, 2, 4 or 8 bytes with a number that breaks things.
void put_number(std::uint8_t* data, std::size_t size) {
  static constexpr std::array<std::uint64_t, 12> kNumbers{
      0,         1,          0x7f,       0xff,       0x7fff,
      0xffff,    0x7fffffff, 0xffffffff, 0x7fc00000, 0x7fffffffffffffff,
      ~0ull - 7, 1ull << 32};
  const std::size_t width = std::min(std::size_t{1} << mutations.below(4), size);
  const std::uint64_t number = kNumbers[static_cast<std::size_t>(mutations.below(kNumbers.size()))] +
                               static_cast<std::uint64_t>(mutations.in(-1, 1));
  std::memcpy(data + mutations.below(static_cast<int>(size - width + 1)), &number, width);
}

std::size_t erase(std::uint8_t* data, std::size_t size) {
  const auto at = static_cast<std::size_t>(mutations.below(static_cast<int>(size)));
  const std::size_t n = std::min(static_cast<std::size_t>(mutations.in(1, 32)), size - at);
  std::memmove(data + at, data + at + n, size - at - n);
  return size - n;
}

/// Puts a piece of the input, or one byte again and again, somewhere else into it.
std::size_t insert(std::uint8_t* data, std::size_t size, std::size_t max_size) {
  const std::size_t n = std::min({static_cast<std::size_t>(mutations.in(1, 64)), max_size - size, size});
  if (n == 0) return size;
  const auto to = static_cast<std::size_t>(mutations.below(static_cast<int>(size + 1)));
  const auto from = static_cast<std::size_t>(mutations.below(static_cast<int>(size - n + 1)));
  std::vector<std::uint8_t> piece(data + from, data + from + n);
  if (mutations.chance(0.3)) std::ranges::fill(piece, static_cast<std::uint8_t>(mutations.next()));
  std::memmove(data + to + n, data + to, size - to);
  std::memcpy(data + to, piece.data(), n);
  return size + n;
}

}  // namespace

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size) {
  if (size == 0) {
    if (max_size == 0) return 0;
    data[0] = static_cast<std::uint8_t>(mutations.next());
    return 1;
  }
  std::uint8_t& byte = data[mutations.below(static_cast<int>(size))];
  switch (mutations.below(6)) {
    case 0:
      byte = static_cast<std::uint8_t>(byte ^ (1u << mutations.below(8)));
      return size;
    case 1:
      byte = static_cast<std::uint8_t>(mutations.next());
      return size;
    case 2:
      byte = static_cast<std::uint8_t>("0123456789.-+e \n,:[]{}\"'#"[mutations.below(25)]);
      return size;
    case 3:
      put_number(data, size);
      return size;
    case 4:
      return erase(data, size);
    default:
      return insert(data, size, max_size);
  }
}

int main(int argc, char** argv) {
  const Options options = parse(argc, argv);
  find_name = fs::path(argv[0]).filename().string() + ".find";
  catch_crashes();
  const auto seeds = read_seeds(options.paths);
  for (const std::string& seed : seeds) {
    input = seed;
    run_input();
  }
  mutations = Random(options.seed);
  std::uint64_t run = 0;
  for (; !seeds.empty() && run < options.runs && cpu_seconds() < options.seconds; ++run) {
    input = seeds[static_cast<std::size_t>(mutations.below(static_cast<int>(seeds.size())))];
    for (int n = mutations.in(1, 4); n > 0; --n) mutate_input();
    run_input();
  }
  std::printf("%zu seeds, %llu mutations, %.1f s, %ld MiB\n", seeds.size(),
              static_cast<unsigned long long>(run), cpu_seconds(), peak_kib() / 1024);
  return seeds.empty() ? 1 : 0;
}
