#include "apgm/format/stream.hpp"
#include "cli_test.hpp"
#include "edited_map.hpp"

namespace apgm::test {
namespace {

class DeltaCliTest : public CliTest {
 protected:
  /// Of the same types: the comparison refuses others.
  static Map edited(const Map& map, std::uint64_t seed) {
    Edits edits;
    edits.other_types = false;
    return edited_map(map, seed, edits);
  }
  /// a.apgm, b.apgm that it became, and the delta between them.
  void write_delta(std::uint64_t seed = 1) const {
    const Map map = random_map(seed);
    write("a.apgm", map);
    write("b.apgm", edited(map, seed + 1000));
    const Outcome outcome = tool("diff", {"a.apgm", "b.apgm", "--delta", "ab.apgm"});
    EXPECT_EQ(outcome.code, 1) << outcome.err;
    EXPECT_EQ(outcome.err, "");
  }
  void write_stream(const std::string& base, const std::string& other, const std::string& name) const {
    const Outcome outcome = tool("diff", {base, other, "--delta", name, "--stream", "--mtu", "1400"});
    EXPECT_EQ(outcome.code, 1) << outcome.err;
  }
  Outcome apply(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), "--apply");
    arguments.insert(arguments.end(), {"-o", "out.apgm"});
    return tool("merge", arguments);
  }
  std::string id(const std::string& name) const { return info(name)["map"]["content_id"]; }
};

TEST_F(DeltaCliTest, AppliedToItsBaseIsTheOtherMapByteForByte) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    SCOPED_TRACE(seed);
    write_delta(seed);
    expect_silent(apply({"ab.apgm", "a.apgm"}));
    EXPECT_EQ(bytes("out.apgm"), bytes("b.apgm"));
    EXPECT_EQ(tool("diff", {"--level", "bytes", "out.apgm", "b.apgm"}).code, 0);
    for (const char* name : {"ab.apgm", "out.apgm"}) std::filesystem::remove(path(name));
  }
}

TEST_F(DeltaCliTest, SaysWhatItWrote) {
  write_delta();
  const Outcome outcome = tool("diff", {"a.apgm", "b.apgm", "--delta", "ab.apgm", "-O", "--json"});
  const Json delta = Json::parse(outcome.out)["delta"];
  EXPECT_EQ(delta["path"], "ab.apgm");
  EXPECT_EQ(delta["bytes"], bytes("ab.apgm").size());
  EXPECT_EQ(delta["base_content_id"], id("a.apgm"));
  EXPECT_EQ(delta["result_content_id"], id("b.apgm"));
  EXPECT_GT(delta["layers"], 0);
  EXPECT_GT(delta["layers_gone"], 0);
  const Json document = Json::parse(apply({"ab.apgm", "a.apgm", "--json"}).out);
  EXPECT_EQ(document["base"]["content_id"], id("a.apgm"));
  EXPECT_EQ(document["deltas"][0], Json({{"path", "ab.apgm"}, {"result_content_id", id("b.apgm")}}));
  EXPECT_EQ(document["content_id"], id("b.apgm"));
  EXPECT_EQ(document["layers"], document["layers_stored"]);
  const Json metadata = info("ab.apgm")["map"]["metadata"];
  EXPECT_EQ(metadata["apgm.base"], id("a.apgm"));
  EXPECT_FALSE(info("out.apgm")["map"]["metadata"].contains("apgm.base"));
}

TEST_F(DeltaCliTest, OfEqualMapsEndsWithZero) {
  write_random("a.apgm", 3);
  EXPECT_EQ(tool("diff", {"a.apgm", "a.apgm", "--delta", "d.apgm"}).code, 0);
  expect_silent(apply({"d.apgm", "a.apgm"}));
  EXPECT_EQ(bytes("out.apgm"), bytes("a.apgm"));
}

TEST_F(DeltaCliTest, ReplacesNothingUnlessAsked) {
  write_delta();
  put("old.apgm", "old");
  expect_failure(tool("diff", {"a.apgm", "b.apgm", "--delta", "old.apgm"}), 5, "'old.apgm' already exists",
                 "pass --overwrite");
  EXPECT_EQ(bytes("old.apgm"), "old");
  EXPECT_EQ(tool("diff", {"-O", "a.apgm", "b.apgm", "--delta", "old.apgm"}).code, 1);
  EXPECT_EQ(bytes("old.apgm"), bytes("ab.apgm"));
  expect_failure(tool("diff", {"-O", "a.apgm", "b.apgm", "--delta", "b.apgm"}), 2, "'b.apgm'");
  expect_failure(tool("diff", {"a.apgm", "b.apgm", "--delta", "-"}), 2, "standard output");
  expect_failure(tool("diff", {"a.apgm", "b.apgm", "--delta", "x", "--png", "x"}), 2, "same file 'x'");
}

TEST_F(DeltaCliTest, DeltasChain) {
  write_delta();
  write("c.apgm", edited(random_map(9), 10));
  EXPECT_EQ(tool("diff", {"b.apgm", "c.apgm", "--delta", "bc.apgm"}).code, 1);
  expect_silent(apply({"ab.apgm", "--apply", "bc.apgm", "a.apgm"}));
  EXPECT_EQ(bytes("out.apgm"), bytes("c.apgm"));
  expect_failure(apply({"bc.apgm", "--apply", "ab.apgm", "a.apgm", "-O"}), 7,
                 "'bc.apgm' is for another base");
}

TEST_F(DeltaCliTest, AnotherBaseIsRefused) {
  write_delta();
  write_random("other.apgm", 77);
  const Outcome outcome = apply({"ab.apgm", "other.apgm"});
  expect_failure(outcome, 7, "'ab.apgm' is for another base", "apgm-info");
  EXPECT_THAT(outcome.err, HasSubstr(id("a.apgm")));
  EXPECT_THAT(outcome.err, HasSubstr(id("other.apgm")));
  expect_failure(apply({"ab.apgm", "b.apgm"}), 7, "is for another base", "already what the delta leads to");
  EXPECT_FALSE(exists("out.apgm"));
}

TEST_F(DeltaCliTest, AnotherFrameIsRefused) {
  RandomMapOptions options;
  options.frame.datum_x_um = 1;
  write_random("a.apgm", 1);
  write_random("shifted.apgm", 1, options);
  const Outcome outcome = tool("diff", {"a.apgm", "shifted.apgm", "--delta", "d.apgm"});
  expect_failure(outcome, 7, "frames", "same datum");
  EXPECT_FALSE(exists("d.apgm"));
}

TEST_F(DeltaCliTest, TypesThatDifferAreRefusedAndLeaveNothing) {
  MapHeader header = empty_map().header();
  header.types = TypeTable({LayerType::semantic("s", {"a", "b"})});
  write("a.apgm", Map(header));
  header.types = TypeTable({LayerType::semantic("s", {"a", "c"})});
  write("b.apgm", Map(header));
  expect_failure(tool("diff", {"a.apgm", "b.apgm", "--delta", "d.apgm"}), 7,
                 "'s' stands for other hypotheses");
  EXPECT_FALSE(exists("d.apgm"));
}

TEST_F(DeltaCliTest, WhatIsNoDeltaIsRefused) {
  write_delta();
  expect_failure(apply({"b.apgm", "a.apgm"}), 4, "'b.apgm' is not a delta", "--delta");
  expect_failure(tool("diff", {"a.apgm", "ab.apgm", "--delta", "d.apgm"}), 7, "is itself a delta",
                 "apgm-merge --apply");
  put("cut.apgm", bytes("ab.apgm").substr(0, bytes("ab.apgm").size() - 300));
  expect_failure(apply({"cut.apgm", "a.apgm"}), 4, "'cut.apgm' is damaged");
  EXPECT_FALSE(exists("out.apgm"));
}

TEST_F(DeltaCliTest, OptionsThatMakeNoSenseAreRefused) {
  write_delta();
  for (const std::vector<std::string>& extra : {std::vector<std::string>{"--rule", "mean"},
                                                {"--discount", "a.apgm=0.5"},
                                                {"--resolution", "1"},
                                                {"--regrid"},
                                                {"--assume-frame", "map"},
                                                {"--conflict-map", "k.png"},
                                                {"--lossy", "u8"}}) {
    SCOPED_TRACE(extra[0]);
    std::vector<std::string> arguments{"ab.apgm", "a.apgm"};
    arguments.insert(arguments.end(), extra.begin(), extra.end());
    expect_failure(apply(arguments), 2, extra[0] + " does not go with --apply");
  }
  expect_failure(apply({"ab.apgm", "a.apgm", "b.apgm"}), 2, "--apply takes one map");
  expect_failure(apply({"-", "-"}), 2, "standard input");
}

TEST_F(DeltaCliTest, AsAStreamKeepsToTheMtu) {
  write_delta();
  const Outcome outcome =
      tool("diff", {"a.apgm", "b.apgm", "--delta", "ab.apgms", "--stream", "--mtu", "512", "--json"});
  EXPECT_EQ(outcome.code, 1) << outcome.err;
  const Json delta = Json::parse(outcome.out)["delta"];
  EXPECT_EQ(delta["stream"], true);
  EXPECT_EQ(delta["bytes"], bytes("ab.apgms").size());
  const Outcome read = tool("convert", {"ab.apgms", "-o", "out.apgm"});
  expect_failure(read, 7, "holds changes of map " + id("a.apgm"));
  expect_failure(tool("diff", {"a.apgm", "b.apgm", "--stream"}), 2, "--stream is for deltas");
}

TEST_F(DeltaCliTest, AStreamOfChangesIsAppliedAsAFileIs) {
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    SCOPED_TRACE(seed);
    write_delta(seed);
    write_stream("a.apgm", "b.apgm", "ab.apgms");
    expect_silent(apply({"ab.apgms", "a.apgm"}));
    EXPECT_EQ(bytes("out.apgm"), bytes("b.apgm"));
    for (const char* name : {"ab.apgm", "ab.apgms", "out.apgm"}) std::filesystem::remove(path(name));
  }
}

TEST_F(DeltaCliTest, StreamsAndFilesChain) {
  write_delta();
  write("c.apgm", edited(random_map(9), 10));
  write("d.apgm", edited(random_map(11), 12));
  write_stream("a.apgm", "b.apgm", "ab.apgms");
  EXPECT_EQ(tool("diff", {"b.apgm", "c.apgm", "--delta", "bc.apgm"}).code, 1);
  write_stream("c.apgm", "d.apgm", "cd.apgms");
  const Outcome outcome =
      apply({"ab.apgms", "--apply", "bc.apgm", "--apply", "cd.apgms", "a.apgm", "--json"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(bytes("out.apgm"), bytes("d.apgm"));
  const Json deltas = Json::parse(outcome.out)["deltas"];
  EXPECT_EQ(deltas[0]["result_content_id"], id("b.apgm"));
  EXPECT_EQ(deltas[0]["stream"]["blocks_lost"], 0);
  EXPECT_FALSE(deltas[1].contains("stream"));
  EXPECT_EQ(deltas[2]["result_content_id"], id("d.apgm"));
  expect_failure(apply({"cd.apgms", "--apply", "ab.apgms", "c.apgm", "-O"}), 7,
                 "'ab.apgms' is for another base");
}

TEST_F(DeltaCliTest, AStreamOfChangesComesThroughAPipe) {
  write_delta();
  write_stream("a.apgm", "b.apgm", "ab.apgms");
  Launch launch;
  launch.input = path("ab.apgms");
  expect_silent(tool("merge", {"--apply", "-", "a.apgm", "-o", "out.apgm"}, launch));
  EXPECT_EQ(bytes("out.apgm"), bytes("b.apgm"));
  const std::string merge = command("merge", {})[0];
  for (const std::string name : {"ab.apgm", "ab.apgms"}) {  // pipes, by either name
    for (const char* input : {"-", "/dev/stdin"}) {
      const Outcome piped = run({"/bin/sh", "-c",
                                 "cat " + path(name) + " | " + merge + " --apply " + input + " " +
                                     path("a.apgm") + " -O -o " + path("out.apgm")});
      EXPECT_EQ(piped.code, 0) << name << " from " << input << ": " << piped.err;
      EXPECT_EQ(bytes("out.apgm"), bytes("b.apgm"));
    }
  }
}

TEST_F(DeltaCliTest, AStreamForAnotherBaseIsRefused) {
  write_delta();
  write_stream("a.apgm", "b.apgm", "ab.apgms");
  write_random("other.apgm", 77);
  RandomMapOptions options;
  options.frame.frame_id = "elsewhere";
  write_random("elsewhere.apgm", 77, options);
  for (const char* base : {"other.apgm", "elsewhere.apgm"}) {
    const Outcome outcome = apply({"ab.apgms", base});
    expect_failure(outcome, 7, "'ab.apgms' is for another base", "apgm-info");
    EXPECT_THAT(outcome.err, HasSubstr(id("a.apgm")));
    EXPECT_THAT(outcome.err, HasSubstr(id(base)));
  }
  expect_failure(apply({"ab.apgms", "b.apgm"}), 7, "is for another base", "already what the delta leads to");
  EXPECT_FALSE(exists("out.apgm"));
}

TEST_F(DeltaCliTest, AStreamThatIsNotWholeOrNoDeltaIsRefused) {
  write_delta();
  write_stream("a.apgm", "b.apgm", "ab.apgms");
  const std::string whole = bytes("ab.apgms");
  put("cut.apgms", whole.substr(0, whole.size() / 2));
  expect_failure(apply({"cut.apgms", "a.apgm"}), 4, "it ends in the middle of a message",
                 "nothing is applied of a part");
  std::string damaged = whole;
  damaged[damaged.size() / 2] ^= 0x20;
  put("bad.apgms", damaged);
  expect_failure(apply({"bad.apgms", "a.apgm"}), 4, "'bad.apgms' is not whole: 1 block is lost");
  put("text.apgms", "not a stream\n");
  expect_failure(apply({"text.apgms", "a.apgm"}), 4, "'text.apgms' is not whole");
  put("empty.apgms", "");
  expect_failure(apply({"empty.apgms", "a.apgm"}), 4, "'empty.apgms' is not whole");
  expect_failure(apply({"absent.apgms", "a.apgm"}), 4, "cannot open 'absent.apgms'");
  expect_silent(tool("convert", {"b.apgm", "-o", "map.apgms"}));
  expect_failure(apply({"map.apgms", "a.apgm"}), 4, "'map.apgms' is not a delta", "--stream");
  EXPECT_FALSE(exists("out.apgm"));
}

TEST_F(DeltaCliTest, AStreamThatNamesNoResultIsRefused) {
  write_random("a.apgm", 1);
  std::string stream;
  StreamWriter writer(
      [&](std::span<const std::byte> block) {
        stream.append(reinterpret_cast<const char*>(block.data()), block.size());
      },
      random_map(1).header());
  writer.end({.base = id("a.apgm"), .result = ""});
  put("open.apgms", stream);
  expect_failure(apply({"open.apgms", "a.apgm"}), 4, "'open.apgms' does not say which map it leads to");
  EXPECT_FALSE(exists("out.apgm"));
}

TEST_F(DeltaCliTest, WhatDoesNotLeadToItsResultIsNoDelta) {
  write_delta();
  MapHeader header = random_map(1).header();
  header.metadata["apgm.base"] = id("a.apgm");
  header.metadata["apgm.result"] = id("b.apgm");
  write("x.apgm", Map(header));
  expect_failure(apply({"x.apgm", "a.apgm"}), 4, "'x.apgm' is not the delta it says it is", "apgm-verify");
}

TEST_F(DeltaCliTest, PartsOfItAreNoDeltas) {
  write_delta();
  const std::vector<std::pair<std::string, std::vector<std::string>>> calls{
      {"crop", {"--bbox", "0,0,1000,1000"}},
      {"resample", {"--step", "2"}},
      {"convert", {"--layer", "occupancy"}},
      {"convert", {"--lossy", "u8"}}};
  for (const auto& [verb, options] : calls) {
    SCOPED_TRACE(verb + " " + options[0]);
    std::vector<std::string> arguments{"ab.apgm", "-O", "-o", "part.apgm"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    const Outcome outcome = tool(verb, arguments);
    EXPECT_TRUE(outcome.code == 0 || outcome.code == 3) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("warning: 'ab.apgm' is a delta"));
    const Json metadata = info("part.apgm")["map"]["metadata"];
    for (const char* key : {"apgm.base", "apgm.result", "apgm.gone"}) EXPECT_FALSE(metadata.contains(key));
    expect_failure(apply({"part.apgm", "a.apgm"}), 4, "'part.apgm' is not a delta");
  }
  expect_silent(tool("convert", {"ab.apgm", "--level", "9", "-o", "packed.apgm"}));
  expect_silent(apply({"packed.apgm", "a.apgm"}));
}

TEST_F(DeltaCliTest, MergedAsAMapGivesAWarning) {
  write_delta();
  const Outcome outcome = tool("merge", {"ab.apgm", "a.apgm", "-o", "out.apgm"});
  EXPECT_THAT(outcome.err, HasSubstr("warning: 'ab.apgm' holds changes of a map, not a whole one"));
}

class BlameCliTest : public CliTest {
 protected:
  /// Two maps of one cell each at (1, 1) m, one of another place, and the three merged.
  void write_merge() const {
    for (const auto& [name, occupied] : {std::pair{"a.apgm", 0.5f}, std::pair{"b.apgm", 0.25f}}) {
      Map map = empty_map();
      map.layer({0, 0}, 0, 3).at(0, {0, 0}) = occupied;
      write(name, map);
    }
    Map elsewhere = empty_map();
    elsewhere.layer({5, 5}, 0, 3).at(0, {0, 0}) = 0.5f;
    write("far.apgm", elsewhere);
    expect_silent(tool("merge", {"a.apgm", "b.apgm", "far.apgm", "-o", "all.apgm"}));
  }
  std::string id(const std::string& name) const { return info(name)["map"]["content_id"]; }
};

TEST_F(BlameCliTest, NamesWhoObservedThePoint) {
  write_merge();
  const Outcome outcome = tool("diff", {"--blame", "1,1", "all.apgm", "a.apgm", "far.apgm"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_EQ(outcome.err, "");
  EXPECT_THAT(outcome.out, HasSubstr("(1, 1) m in 'all.apgm'\n  occupancy: O 0.625, F 0"));
  EXPECT_THAT(outcome.out, HasSubstr(id("a.apgm") + " 'a.apgm' (merge) observed the point\n"));
  EXPECT_THAT(outcome.out, HasSubstr("occupancy: O 0.5, F 0 (cells of 1.6 m)"));
  EXPECT_THAT(outcome.out, HasSubstr(id("b.apgm") + " (merge) no file of it is given"));
  EXPECT_THAT(outcome.out, HasSubstr("'far.apgm' (merge) does not know the point"));
}

TEST_F(BlameCliTest, TellsTheSameAsJson) {
  write_merge();
  const Outcome outcome = tool("diff", {"--json", "--blame", "1,1", "all.apgm", "b.apgm"});
  EXPECT_EQ(outcome.code, 0);
  const Json blame = Json::parse(outcome.out)["blame"];
  EXPECT_EQ(blame["point_m"], Json({1, 1}));
  ASSERT_EQ(blame["inputs"].size(), 3u);
  for (const Json& input : blame["inputs"]) {
    EXPECT_EQ(input["path"].is_null(), input["content_id"] != id("b.apgm"));
    const Json cells = input["path"].is_null() ? Json::array() : input["cells"];
    for (const Json& cell : cells) EXPECT_EQ(cell["values"]["O"], 0.25);
    EXPECT_EQ(cells.size(), input["path"].is_null() ? 0u : 1u);
  }
}

TEST_F(BlameCliTest, NobodyIsExitCodeOne) {
  write_merge();
  const Outcome outcome = tool("diff", {"--blame", "-9,1", "all.apgm", "a.apgm", "b.apgm"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(outcome.out, HasSubstr("'all.apgm' is unknown"));
  const Outcome unmerged = tool("diff", {"--blame", "1,1", "a.apgm", "b.apgm"});
  EXPECT_EQ(unmerged.code, 1);
  EXPECT_THAT(unmerged.out, HasSubstr("its history names no input"));
  EXPECT_THAT(unmerged.err, HasSubstr("warning: 'b.apgm' is not in the history of 'a.apgm'"));
}

TEST_F(BlameCliTest, GoesWithNoOtherQuestion) {
  write_merge();
  expect_failure(tool("diff", {"--blame", "1,1", "--top", "3", "all.apgm"}), 2,
                 "--top does not go with --blame");
  expect_failure(tool("diff", {"--blame", "1,1", "--delta", "d.apgm", "all.apgm"}), 2, "--delta does not go");
  expect_failure(tool("diff", {"--blame", "1", "all.apgm"}), 2, "--blame");
  expect_failure(tool("diff", {"--blame", "1,1"}), 2, "no input");
  expect_failure(tool("diff", {"--blame", "1,1", "all.apgm"}), 2, "one map is given", "MERGED INPUT");
}

TEST_F(BlameCliTest, HistoryIsReadable) {
  write_merge();
  const std::string text = tool("info", {"--history", "all.apgm"}).out;
  EXPECT_THAT(text, HasSubstr("history, oldest first\n  1. merge\n       "));
  EXPECT_THAT(text, HasSubstr("rule dempster"));
  for (const char* name : {"a.apgm", "b.apgm", "far.apgm"}) EXPECT_THAT(text, HasSubstr(id(name)));
}

TEST_F(BlameCliTest, LongTextsAreCutForPeopleOnly) {
  MapHeader header;
  header.metadata["long"] = std::string(10'000, 'x');
  header.history = {{"merge", std::vector<std::string>(40, "aa"), "\"" + std::string(10'000, 'y') + "\""}};
  write("a.apgm", Map(header));
  const std::string text = tool("info", {"--history", "a.apgm"}).out;
  EXPECT_LT(text.size(), 3000u);
  EXPECT_THAT(text, HasSubstr("... (10 000 bytes)"));
  EXPECT_THAT(text, HasSubstr("and 24 more inputs"));
  EXPECT_EQ(info("a.apgm")["map"]["metadata"]["long"].get<std::string>().size(), 10'000u);
}

}  // namespace
}  // namespace apgm::test
