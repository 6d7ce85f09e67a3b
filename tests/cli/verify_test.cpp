#include "apgm/core/error.hpp"
#include "cli_test.hpp"

namespace apgm::test {
namespace {

class VerifyCliTest : public CliTest {
 protected:
  void SetUp() override {
    write("a.apgm", plain_map(3, 2));
    good_ = bytes("a.apgm");
    std::size_t at = 64 + 64;  // the first layer: behind preamble and map header
    std::uint64_t payload = 0;
    std::memcpy(&payload, good_.data() + 64 + 16, 8);
    layer_at_ = at + (payload + 7) / 8 * 8;
  }
  void put_damaged(std::size_t from, std::size_t n) const {
    put("bad.apgm", std::string(good_).replace(from, n, n, '\0'));
  }
  std::string good_;
  std::size_t layer_at_ = 0;
};

TEST_F(VerifyCliTest, ValidFile) {
  const Outcome outcome = tool("verify", {"a.apgm"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_THAT(outcome.out, testing::StartsWith("'a.apgm' is valid: 6 layers in "));
}

TEST_F(VerifyCliTest, JsonOfAValidFile) {
  const Outcome outcome = tool("verify", {"--json", "--deep", "a.apgm"});
  EXPECT_EQ(outcome.code, 0);
  const Json document = Json::parse(outcome.out);
  EXPECT_EQ(document["schema"], "apgm.verify/1");
  EXPECT_EQ(document["valid"], true);
  EXPECT_EQ(document["layers"], 6);
  EXPECT_EQ(document["decoded_layers"], 6);
  EXPECT_EQ(document["problem_count"], 0);
  EXPECT_EQ(document["content_id"], info("a.apgm")["map"]["content_id"]);
}

TEST_F(VerifyCliTest, DamagedFileIsAnsweredWithNo) {
  put_damaged(layer_at_ + 70, 20);
  const Outcome outcome = tool("verify", {"bad.apgm"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(outcome.out,
              HasSubstr("byte " + std::to_string(layer_at_) + ": patch (0,0) layer 'occupancy': "));
  EXPECT_THAT(outcome.out, HasSubstr("'bad.apgm' is damaged: 1 fault; whole are 5 layers"));
  const Json document = Json::parse(tool("verify", {"bad.apgm", "--json"}).out);
  EXPECT_EQ(document["valid"], false);
  EXPECT_EQ(document["problem_count"], 1);
  EXPECT_EQ(document["problems"][0]["offset_bytes"], layer_at_);
  EXPECT_EQ(document["problems"][0]["patch"], Json({0, 0}));
  EXPECT_EQ(document["problems"][0]["layer"], "occupancy");
}

TEST_F(VerifyCliTest, WhatIsNoApgmFileIsAnInputError) {
  put("a.bt", "# Octomap OcTree binary file\n");
  expect_failure(tool("verify", {"a.bt"}), 4, "'a.bt' is not an apgm file");
  expect_failure(tool("verify", {"gone.apgm"}), 4, "cannot open 'gone.apgm'");
}

TEST_F(VerifyCliTest, StandardInput) {
  Launch launch;
  launch.input = path("a.apgm");
  EXPECT_EQ(tool("verify", {"-"}, launch).code, 0);
}

TEST_F(VerifyCliTest, RecoverWithoutLoss) {
  put_damaged(0, 64);
  EXPECT_EQ(tool("verify", {"bad.apgm"}).code, 4);  // even the magic is gone
  const Outcome outcome = tool("verify", {"--recover", "bad.apgm", "-o", "out.apgm"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(info("out.apgm")["map"]["content_id"], info("a.apgm")["map"]["content_id"]);
  EXPECT_EQ(info("out.apgm", {"--history"})["history"].back()["operation"], "recover");
}

TEST_F(VerifyCliTest, RecoverListsWhatIsLost) {
  put_damaged(layer_at_, 100);
  const Outcome outcome = tool("verify", {"--recover", "--json", "bad.apgm", "-o", "out.apgm"});
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("lost: patch (0,0) layer 'occupancy': "));
  const Json document = Json::parse(outcome.out);
  EXPECT_EQ(document["loss_count"], 1);
  EXPECT_EQ(document["lost"][0]["patch"], Json({0, 0}));
  EXPECT_EQ(document["layers"], 5);
  EXPECT_EQ(tool("verify", {"--deep", "out.apgm"}).code, 0);
}

TEST_F(VerifyCliTest, HeaderFromAnotherMap) {
  put_damaged(64, layer_at_ - 64);
  expect_failure(tool("verify", {"--recover", "bad.apgm", "-o", "out.apgm"}), 4, "no map header is left",
                 "--header-from");
  EXPECT_FALSE(exists("out.apgm"));
  const Outcome outcome =
      tool("verify", {"--recover", "--header-from", "a.apgm", "bad.apgm", "-o", "out.apgm"});
  EXPECT_EQ(outcome.code, 3);
  EXPECT_EQ(info("out.apgm")["map"]["patches"], 6);
}

TEST_F(VerifyCliTest, ABudgetThatHoldsNoLayerIsALimit) {
  Map map = plain_map(1, 1);
  map.layer({7, 7}, 0, 10).plane(0)[5] = 0.125f;
  write("large.apgm", map);
  expect_failure(tool("verify", {"--deep", "--max-memory", "16M", "large.apgm"}), 6,
                 "does not hold the largest layer while it is decoded", "with at least ");
  EXPECT_EQ(tool("verify", {"--deep", "--max-memory", "64M", "large.apgm"}).code, 0);
}

TEST_F(VerifyCliTest, ACommitWithoutItsFooterIsALoss) {
  for (const char* message : {"one", "two"}) {
    EXPECT_EQ(tool("archive", {"commit", "arch.apgm", "a.apgm", "-m", message}).code, 0);
    write("a.apgm", plain_map(4, 2));
  }
  std::string torn = bytes("arch.apgm");
  put("torn.apgm", torn.replace(torn.size() - 256, 256, 256, '\0'));
  EXPECT_EQ(tool("verify", {"torn.apgm"}).code, 1);
  const Outcome outcome = tool("verify", {"--recover", "--json", "torn.apgm", "-o", "out.apgm"});
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("lost: a commit that was not finished, 2 layers, is left out"));
  const Json document = Json::parse(outcome.out);
  EXPECT_EQ(document["uncommitted_layers"], 2);
  EXPECT_EQ(document["layers"], 6);
}

TEST_F(VerifyCliTest, RecoveringAnArchiveTellsOfTheCommitsThatAreLeftOut) {
  for (const int side : {3, 4, 5}) {
    write("a.apgm", plain_map(side, 2));
    EXPECT_EQ(tool("archive", {"commit", "arch.apgm", "a.apgm"}).code, 0);
  }
  EXPECT_EQ(tool("archive", {"tag", "arch.apgm", "best"}).code, 0);
  const Outcome outcome = tool("verify", {"--recover", "--json", "arch.apgm", "-o", "out.apgm"});
  EXPECT_EQ(outcome.code, 0) << "the last commit is whole";
  EXPECT_THAT(outcome.err,
              HasSubstr("note: only commit 3 is written: 2 older commits of the archive are left "
                        "out; 'apgm-archive checkout --salvage --at N' saves one"));
  EXPECT_EQ(Json::parse(outcome.out)["older_commits"], 2);
  EXPECT_EQ(info("out.apgm")["map"]["patches"], 10);
  EXPECT_EQ(
      Json::parse(tool("verify", {"--recover", "--json", "out.apgm", "-o", "b.apgm"}).out)["older_commits"],
      0);
}

TEST_F(VerifyCliTest, OptionsThatDoNotFit) {
  expect_failure(tool("verify", {"a.apgm", "-o", "b.apgm"}), 2, "nothing is written without --recover");
  expect_failure(tool("verify", {"a.apgm", "--recover"}), 2, "no output is given");
  expect_failure(tool("verify", {"a.apgm", "--recover", "--deep", "-o", "b.apgm"}), 2, "exclude each other");
  expect_failure(tool("verify", {"a.apgm", "--header-from", "b.apgm"}), 2, "--header-from needs --recover");
  expect_failure(tool("verify", {"a.apgm", "b.apgm"}), 2, "one input is read");
}

}  // namespace
}  // namespace apgm::test
