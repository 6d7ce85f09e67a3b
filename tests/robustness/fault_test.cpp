#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <filesystem>

#include "writers.hpp"

namespace apgm::test {
namespace {

using testing::AnyOf;
using testing::IsEmpty;

/// Calls that fail one after the other, of each kind and command: enough to meet the first, the last and
/// those between in many places.
constexpr long kMostPlaces = 4;

const Workshop& workshop() {
  static const Workshop shop(3);
  return shop;
}

/// Environment of a tool whose disk fails by `fault`, as fault_shim.cpp reads it.
std::vector<std::string> with_fault(const std::string& fault, const std::string& count_file = "") {
  return {std::string("LD_PRELOAD=") + APGM_FAULT_SHIM,
          "APGM_FAULT_DIR=" + std::filesystem::canonical(workshop().directory()).string(),
          "APGM_FAULT=" + fault, "APGM_FAULT_COUNT=" + count_file};
}

class FaultTest : public testing::TestWithParam<WriterCommand> {
 protected:
  void SetUp() override {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "the sanitizer's own library must be loaded first";
#endif
    expected_ = workshop().expected(GetParam());
  }

  long calls(const std::string& kind) const {
    const TempDir elsewhere;
    workshop().put_old(GetParam());
    workshop().run(GetParam(), with_fault(kind + ":0:5", elsewhere / "count"));
    const std::string text = read_file(elsewhere / "count");
    EXPECT_NE(text, "") << "the shim was not loaded";
    return text.empty() ? 0 : std::stol(text);
  }

  /// Fails each of up to kMostPlaces calls of a kind. @return how many ended the tool
  long sweep(const std::string& kind, int error, const std::vector<int>& codes) const {
    const long all = calls(kind), step = std::max(1L, all / kMostPlaces);
    long failed = 0;
    for (long at = 1; at <= all; at += step) {
      SCOPED_TRACE(kind + " " + std::to_string(at) + " of " + std::to_string(all) + " fails");
      failed += expect_all_or_nothing(kind + ":" + std::to_string(at) + ":" + std::to_string(error), codes);
    }
    return failed;
  }

  bool expect_all_or_nothing(const std::string& fault, const std::vector<int>& codes) const {
    const Workshop& shop = workshop();
    shop.put_old(GetParam());
    const Outcome outcome = shop.run(GetParam(), with_fault(fault));
    EXPECT_THAT(shop.strangers(GetParam()), IsEmpty());
    if (outcome.code == 0 || outcome.code == 3) {
      EXPECT_TRUE(shop.outputs(GetParam()) == expected_) << "it said that all is well";
      return false;
    }
    EXPECT_THAT(codes, testing::Contains(outcome.code)) << outcome.err;
    EXPECT_THAT(outcome.err, testing::HasSubstr(": error: "));
    EXPECT_TRUE(shop.outputs(GetParam()) == shop.old(GetParam()))
        << "the old output changed: " << outcome.err;
    return true;
  }

  std::vector<std::string> expected_;
};

TEST_P(FaultTest, WritesThatFail) {
  EXPECT_GT(sweep("write", EIO, {5}), 0);
  sweep("write", ENOSPC, {5});
}

TEST_P(FaultTest, SyncsThatFail) { EXPECT_GT(sweep("sync", EIO, {5}), 0); }

TEST_P(FaultTest, FilesThatCannotBeMadeOrNamed) {
  EXPECT_GT(sweep("create", EACCES, {5}), 0);
  // Two outputs are named one after the other: what is named first stays.
  if (GetParam().outputs.size() == 1) {
    EXPECT_GT(sweep("rename", EIO, {5}), 0);
  }
}

// What is read is the input, or an unnamed file of the tool's own.
TEST_P(FaultTest, ReadsThatFail) { sweep("read", EIO, {4, 5}); }

TEST_P(FaultTest, ShortAndInterruptedCallsChangeNothing) {
  for (const std::string kind : {"read", "write"}) {
    for (const std::string how : {"short", "eintr"}) {
      SCOPED_TRACE(kind + " " + how);
      workshop().put_old(GetParam());
      const Outcome outcome = workshop().run(GetParam(), with_fault(kind + ":*:" + how));
      EXPECT_THAT(outcome.code, AnyOf(0, 3)) << outcome.err;
      EXPECT_TRUE(workshop().outputs(GetParam()) == expected_);
      EXPECT_THAT(workshop().strangers(GetParam()), IsEmpty());
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Writers, FaultTest, testing::ValuesIn(writer_commands()),
                         [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace apgm::test
