#include "cli_test.hpp"

namespace apgm::test {
namespace {

class StreamCliTest : public CliTest {
 protected:
  void SetUp() override {
    write_random("a.apgm", 7);
    id_ = info("a.apgm")["map"]["content_id"];
  }
  Outcome convert(std::vector<std::string> arguments, Launch launch = {}) const {
    return tool("convert", arguments, launch);
  }
  std::string id_of(const std::string& name) const { return info(name)["map"]["content_id"]; }
  /// a.apgm as a stream, without history, so that its bytes are those of the map.
  void make_stream(const std::string& name, std::vector<std::string> options = {}) const {
    options.insert(options.end(), {"a.apgm", "--stream", "-o", name});
    expect_silent(convert(options));
  }

  std::string id_;
};

TEST_F(StreamCliTest, AMapGoesThroughAStreamAndComesBack) {
  make_stream("s.apgms");
  expect_silent(convert({"s.apgms", "-o", "b.apgm"}));
  EXPECT_EQ(id_of("b.apgm"), id_);
  make_stream("small.apgms", {"--mtu", "256"});
  const Json back = Json::parse(convert({"--json", "small.apgms", "-o", "c.apgm"}).out);
  EXPECT_EQ(back["content_id"], id_);
  EXPECT_EQ(back["input"]["format"], "stream");
  EXPECT_EQ(back["stream"]["blocks_lost"], 0);
  EXPECT_EQ(back["layers_stored"], back["layers"]) << "layers are not encoded again";
}

TEST_F(StreamCliTest, StandardInputAndOutput) {
  Launch to_file;
  to_file.output = path("pipe");
  EXPECT_EQ(convert({"a.apgm", "--stream", "-o", "-"}, to_file).code, 0);
  Launch from_file;
  from_file.input = path("pipe");
  expect_silent(convert({"-", "-o", "b.apgm"}, from_file));
  EXPECT_EQ(id_of("b.apgm"), id_);
  const std::string convert_tool = command("convert", {})[0];
  const Outcome piped = run({"/bin/sh", "-c",
                             convert_tool + " " + path("a.apgm") + " --stream --mtu 1400 -o - | " +
                                 convert_tool + " - -o " + path("c.apgm")});
  EXPECT_EQ(piped.code, 0) << piped.err;
  EXPECT_EQ(id_of("c.apgm"), id_);
}

TEST_F(StreamCliTest, TheExtensionAsksForAStream) {
  expect_silent(convert({"a.apgm", "-o", "s.apgms"}));
  make_stream("t.apgms");
  EXPECT_EQ(bytes("s.apgms"), bytes("t.apgms"));
  expect_silent(convert({"a.apgm", "--mtu", "512", "-o", "u.apgms"}));
  EXPECT_GT(bytes("u.apgms").size(), bytes("s.apgms").size());
}

TEST_F(StreamCliTest, AnotherExtensionGivesAWarning) {
  for (const char* name : {"s.bt", "s.apgm"}) {
    EXPECT_THAT(convert({"a.apgm", "--stream", "-o", name}).err,
                HasSubstr("warning: '" + std::string(name) + "' gets .apgms content"));
  }
  EXPECT_THAT(convert({"a.apgm", "--to", "apgm", "-o", "m.apgms"}).err,
              HasSubstr("warning: 'm.apgms' gets .apgm content"));
}

TEST_F(StreamCliTest, BlocksThatCameAgainAreToldWhenAsked) {
  make_stream("s.apgms");
  const std::string whole = bytes("s.apgms");
  put("twice.apgms", whole + whole.substr(whole.size() - 128));  // its End
  expect_silent(convert({"twice.apgms", "-o", "b.apgm"}));
  EXPECT_EQ(id_of("b.apgm"), id_);
  EXPECT_THAT(convert({"-v", "twice.apgms", "-O", "-o", "b.apgm"}).err, HasSubstr("1 block came again"));
}

TEST_F(StreamCliTest, StreamsBecomeOtherFormatsToo) {
  make_stream("s.apgms");
  EXPECT_EQ(convert({"s.apgms", "--layer", "occupancy", "-o", "m.yaml"}).code,
            convert({"a.apgm", "--layer", "occupancy", "-o", "n.yaml"}).code);
  EXPECT_EQ(exists("m.yaml"), exists("n.yaml"));
  expect_silent(convert({"s.apgms", "--level", "9", "-o", "t.apgms"}));
}

TEST_F(StreamCliTest, AStreamThatEndsInTheMiddleIsRefusedAndSalvaged) {
  make_stream("s.apgms");
  const std::string whole = bytes("s.apgms");
  put("cut.apgms", whole.substr(0, whole.size() / 2));
  expect_failure(convert({"cut.apgms", "-o", "b.apgm"}), 4,
                 "'cut.apgms' is not whole:", "--salvage keeps what arrived");
  EXPECT_FALSE(exists("b.apgm"));
  const Outcome kept = convert({"--salvage", "cut.apgms", "-o", "b.apgm"});
  EXPECT_EQ(kept.code, 3);
  EXPECT_THAT(kept.err, HasSubstr("it ends in the middle of a message"));
  EXPECT_GT(info("b.apgm")["map"]["patches"], 0);
  EXPECT_NE(id_of("b.apgm"), id_);
}

TEST_F(StreamCliTest, ADamagedBlockIsCounted) {
  make_stream("s.apgms");
  std::string damaged = bytes("s.apgms");
  damaged[damaged.size() / 2] ^= 0x20;
  put("bad.apgms", damaged);
  expect_failure(convert({"bad.apgms", "-o", "b.apgm"}), 4, "1 block is lost", "--salvage");
  const Outcome kept = convert({"--json", "--salvage", "bad.apgms", "-o", "b.apgm"});
  EXPECT_EQ(kept.code, 3);
  EXPECT_EQ(Json::parse(kept.out)["stream"]["blocks_lost"], 1);
}

TEST_F(StreamCliTest, WhatHoldsNoMapIsRefusedInAnyCase) {
  make_stream("s.apgms");
  put("head.apgms", bytes("s.apgms").substr(0, 100));
  put("text.apgms", "not a stream\n");
  for (const char* name : {"head.apgms", "text.apgms"}) {
    expect_failure(convert({name, "-o", "b.apgm"}), 4, "holds no map");
    expect_failure(convert({"--salvage", name, "-o", "b.apgm"}), 4, "holds no map");
  }
  expect_failure(convert({"absent.apgms", "-o", "b.apgm"}), 4, "cannot open 'absent.apgms'");
}

TEST_F(StreamCliTest, OtherToolsSayThatItIsAStream) {
  make_stream("s.apgms");
  expect_failure(tool("info", {"s.apgms"}), 4, "'s.apgms' is a stream", "apgm-convert makes a map of it");
}

TEST_F(StreamCliTest, OptionsThatMakeNoSense) {
  expect_failure(convert({"--mtu", "512", "a.apgm", "-o", "b.apgm"}), 2, "--mtu is for streams");
  expect_failure(convert({"--stream", "--mtu", "255", "a.apgm", "-o", "s.apgms"}), 2, "--mtu");
  expect_failure(convert({"--stream", "--to", "octomap", "a.apgm", "-o", "s.apgms"}), 2, "name two formats");
  expect_failure(convert({"--salvage", "a.apgm", "-o", "b.apgm"}), 2, "--salvage is for streams", "crop");
  expect_failure(convert({"--salvage", "--max-loss", "none", "s.apgms", "-o", "b.apgm"}), 2,
                 "--salvage accepts loss");
}

}  // namespace
}  // namespace apgm::test
