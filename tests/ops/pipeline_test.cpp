#include "libapgm/src/ops/pipeline.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <string>
#include <thread>

#include "apgm/core/map.hpp"

namespace apgm::ops {
namespace {

/// Numbers 0..count-1; the consumer notes their order.
class Numbers : public Stream {
 public:
  struct Numbered final : Job {
    int number = 0;
  };
  explicit Numbers(int n) : count(n) {}
  std::unique_ptr<Job> make_job() const override { return std::make_unique<Numbered>(); }
  bool produce(Job& job) override {
    if (next == count) return false;
    static_cast<Numbered&>(job).number = next++;
    in_flight_max = std::max(in_flight_max, ++in_flight);
    return true;
  }
  void work(Job& job) const override {
    const int n = static_cast<Numbered&>(job).number;
    if (n % 7 == 0) std::this_thread::sleep_for(std::chrono::microseconds(300));
    if (n == fails_at || n == fails_at + 3) {
      throw Error(ErrorCode::kDamaged, "number " + std::to_string(n));
    }
    if (n % 10 == 0) job.findings.push_back({Finding::Kind::kNote, std::to_string(n)});
  }
  void consume(Job& job) override {
    seen.push_back(static_cast<Numbered&>(job).number);
    --in_flight;
  }

  int count;
  int next = 0;
  int fails_at = -100;
  std::atomic<int> in_flight{0};
  int in_flight_max = 0;
  std::vector<int> seen;
};

class RunStream : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Threads, RunStream, testing::Values(1, 2, 4));

TEST_P(RunStream, ConsumesInTheOrderProduced) {
  Numbers numbers(500);
  RunOptions run;
  run.threads = GetParam();
  std::vector<std::uint64_t> progress;
  run.progress = [&](std::uint64_t done, std::uint64_t total) {
    EXPECT_EQ(total, 500u);
    progress.push_back(done);
  };
  std::vector<std::string> findings;
  run.findings = [&](const Finding& f) { findings.push_back(f.text); };
  run_stream(numbers, {500, 1}, run);
  ASSERT_EQ(numbers.seen.size(), 500u);
  EXPECT_TRUE(std::ranges::is_sorted(numbers.seen));
  ASSERT_EQ(progress.size(), 500u);
  EXPECT_TRUE(std::ranges::is_sorted(progress));
  EXPECT_EQ(progress.back(), 500u);
  ASSERT_EQ(findings.size(), 50u);
  EXPECT_EQ(findings[7], "70");
}

TEST_P(RunStream, KeepsNoMoreJobsThanTokensHoweverLongTheStream) {
  for (const int count : {100, 5000}) {
    Numbers numbers(count);
    RunOptions run;
    run.threads = GetParam();
    run.max_memory_bytes = 3500;
    const std::size_t made = run_stream(numbers, {0, 1000}, run);
    EXPECT_LE(made, 3u);
    EXPECT_LE(numbers.in_flight_max, 3);
    EXPECT_EQ(numbers.seen.size(), static_cast<std::size_t>(count));
  }
}

TEST_P(RunStream, ThrowsTheFirstFailureInOrderAfterWhatCameBefore) {
  for (int round = 0; round < 20; ++round) {
    Numbers numbers(200);
    numbers.fails_at = 56;
    RunOptions run;
    run.threads = GetParam();
    try {
      run_stream(numbers, {200, 1}, run);
      FAIL() << "no failure";
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::kDamaged);
      EXPECT_EQ(e.message(), "number 56");
    }
    EXPECT_EQ(numbers.seen.size(), 56u);
  }
}

TEST_P(RunStream, StopsWhereTheConsumerFails) {
  class Failing final : public Numbers {
   public:
    using Numbers::Numbers;
    void consume(Job& job) override {
      Numbers::consume(job);
      if (seen.size() == 30) throw Error(ErrorCode::kOutput, "full");
    }
  };
  for (int round = 0; round < 20; ++round) {
    Failing numbers(100'000);
    RunOptions run;
    run.threads = GetParam();
    try {
      run_stream(numbers, {0, 1}, run);
      FAIL() << "no failure";
    } catch (const Error& e) {
      EXPECT_EQ(e.message(), "full");
    }
    EXPECT_EQ(numbers.seen.size(), 30u);
    EXPECT_LE(numbers.next, 30 + 4 * 4 + 1);
  }
}

TEST_P(RunStream, LendsEveryJobADeskOfItsOwn) {
  class Writing final : public Numbers {
   public:
    using Numbers::Numbers;
    void work(Job& job) const override {
      const auto number = static_cast<float>(static_cast<Numbered&>(job).number);
      job.desk.scratch.reshape(1, 5);
      std::ranges::fill(job.desk.scratch.plane(0), number);
      Numbers::work(job);
      for (const float v : job.desk.scratch.plane(0)) disturbed += v != number;
    }
    mutable std::atomic<int> disturbed{0};
  };
  Writing numbers(500);
  RunOptions run;
  run.threads = GetParam();
  run_stream(numbers, {500, 1}, run);
  EXPECT_EQ(numbers.disturbed, 0);
}

TEST_P(RunStream, StopsWhenCancelled) {
  Numbers numbers(1'000'000);
  std::atomic<bool> cancel{false};
  RunOptions run;
  run.threads = GetParam();
  run.cancel = &cancel;
  run.progress = [&](std::uint64_t done, std::uint64_t) { cancel = done >= 50; };
  try {
    run_stream(numbers, {0, 1}, run);
    FAIL() << "not cancelled";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kCancelled);
  }
  EXPECT_GE(numbers.seen.size(), 50u);
  EXPECT_LE(numbers.seen.size(), 50u + 4 * 4 + 1);
}

TEST_P(RunStream, RefusesABudgetBelowOneJob) {
  Numbers numbers(5);
  RunOptions run;
  run.threads = GetParam();
  run.max_memory_bytes = 999;
  try {
    run_stream(numbers, {5, 1000}, run);
    FAIL() << "no failure";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kLimit);
    EXPECT_THAT(e.hint(), testing::HasSubstr("1 MiB"));
  }
  EXPECT_EQ(numbers.next, 0);
}

TEST(LargestLayers, TakesTheFinestStepOfEachType) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy(), LayerType::real("z", {"z"})});
  Map map(header);
  map.layer({0, 0}, 0, 3);
  map.layer({1, 0}, 0, 5);
  EXPECT_THAT(largest_layers(map), testing::ElementsAre(1024u * 2 * 4, 0u));
}

}  // namespace
}  // namespace apgm::ops
