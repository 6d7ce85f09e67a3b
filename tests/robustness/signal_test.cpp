#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include "random_map.hpp"
#include "writers.hpp"

namespace apgm::test {
namespace {

using std::chrono::microseconds;
using std::chrono::steady_clock;
using testing::AnyOf;
using testing::IsEmpty;

constexpr int kRounds = 2;  // of each signal and command

const Workshop& workshop() {
  static const Workshop shop(6);
  return shop;
}

class SignalTest : public testing::TestWithParam<WriterCommand> {
 protected:
  void SetUp() override {
    const auto start = steady_clock::now();
    expected_ = workshop().expected(GetParam());
    whole_run_ = std::chrono::duration_cast<microseconds>(steady_clock::now() - start);
  }

  /// Runs the command with the old outputs in place and calls `disturb` at a random moment of it.
  template <typename Disturb>
  Outcome run_disturbed(Random& random, Disturb disturb) const {
    workshop().put_old(GetParam());
    Launch launch;
    launch.directory = workshop().directory();
    Process process(workshop().line(GetParam()), launch);
    std::this_thread::sleep_for(
        microseconds(static_cast<std::int64_t>(random.unit() * static_cast<double>(whole_run_.count()))));
    disturb(process);
    return process.wait();
  }

  void expect_whole_or_old(const Outcome& outcome) const {
    EXPECT_THAT(workshop().strangers(GetParam()), IsEmpty());
    const auto outputs = workshop().outputs(GetParam());
    const bool done = outcome.code == 0 || outcome.code == 3;
    EXPECT_TRUE(outputs == (done ? expected_ : workshop().old(GetParam())))
        << "exit code " << outcome.code << ": " << outcome.err;
  }

  std::vector<std::string> expected_;
  microseconds whole_run_{};
};

TEST_P(SignalTest, LeavesTheOldOutputOrTheWholeNewOne) {
  Random random(20'261'122);
  for (int round = 0; round < kRounds; ++round) {
    for (const int number : {SIGINT, SIGTERM, SIGPIPE}) {
      SCOPED_TRACE("signal " + std::to_string(number) + ", round " + std::to_string(round));
      const Outcome outcome = run_disturbed(random, [&](const Process& p) { p.signal(number); });
      // Before the tool is up a signal ends it as it ends any program.
      EXPECT_THAT(outcome.code, AnyOf(0, 3, 130, 128 + number)) << outcome.err;
      expect_whole_or_old(outcome);
    }
  }
}

TEST_P(SignalTest, InputsThatVanish) {
  Random random(7);
  for (int round = 0; round < kRounds; ++round) {
    const std::string& input = GetParam().inputs.back();
    const std::string content = read_file(workshop().path(input));
    const Outcome outcome =
        run_disturbed(random, [&](const Process&) { std::filesystem::remove(workshop().path(input)); });
    write_file(workshop().path(input), content);
    EXPECT_THAT(outcome.code, AnyOf(0, 3, 4)) << outcome.err;
    expect_whole_or_old(outcome);
  }
}

TEST_P(SignalTest, InputsThatAreCutWhileTheyAreRead) {
  Random random(8);
  for (int round = 0; round < kRounds; ++round) {
    const std::string& input = GetParam().inputs.back();
    const std::string content = read_file(workshop().path(input));
    const Outcome outcome = run_disturbed(random, [&](const Process&) {
      std::filesystem::resize_file(workshop().path(input), content.size() / 2);
    });
    write_file(workshop().path(input), content);
    // Text has no end of its own: half a log is a log.
    if (input.ends_with(".log")) {
      EXPECT_THAT(outcome.code, AnyOf(0, 3, 4)) << outcome.err;
      EXPECT_THAT(workshop().strangers(GetParam()), IsEmpty());
      continue;
    }
    EXPECT_THAT(outcome.code, AnyOf(0, 3, 4)) << outcome.err;
    expect_whole_or_old(outcome);
  }
}

INSTANTIATE_TEST_SUITE_P(Writers, SignalTest, testing::ValuesIn(writer_commands()),
                         [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace apgm::test
