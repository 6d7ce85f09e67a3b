#include <array>

#include "cli_test.hpp"

namespace apgm::test {
namespace {

/// The flag table of the tools' contract, by tool.
struct ToolFlags {
  std::string verb;
  std::vector<std::string> flags;
};

const std::vector<std::string> kAll{"-h, --help",    "-V, --version", "-q, --quiet",
                                    "-v, --verbose", "--color",       "--json"};
const std::vector<std::string> kWriter{"-o, --output", "-O, --overwrite", "-n, --dry-run", "--fsync"};
const std::vector<std::string> kMapWriter{"--level", "--lossy", "--stamp", "--no-provenance"};
const std::vector<std::string> kHeavy{"-j, --threads", "--max-memory", "--progress", "--no-progress"};

std::vector<std::string> operator+(std::vector<std::string> a, const std::vector<std::string>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

std::vector<ToolFlags> all_tools() {
  return {
      {"info",
       kAll + kHeavy + std::vector<std::string>{"--layer", "--bbox", "--extended", "--history", "--get"}},
      {"convert", kAll + kWriter + kMapWriter + kHeavy +
                      std::vector<std::string>{"--layer", "--bbox", "--from", "--to", "--formats", "--set",
                                               "--max-loss", "--stream", "--mtu", "--salvage"}},
      {"merge", kAll + kWriter + kMapWriter + kHeavy +
                    std::vector<std::string>{"--rule", "--discount", "--resolution", "--regrid",
                                             "--assume-frame", "--conflict-map", "--apply"}},
      {"crop",
       kAll + kWriter + kMapWriter + kHeavy +
           std::vector<std::string>{"--layer", "--bbox", "--polygon", "--like", "--snap", "--salvage"}},
      {"diff", kAll + kHeavy +
                   std::vector<std::string>{"--layer", "--bbox", "--level", "--tolerance", "--top", "--png",
                                            "-O, --overwrite", "--delta", "--blame", "--stream", "--mtu"}},
      {"resample",
       kAll + kWriter + kMapWriter + kHeavy +
           std::vector<std::string>{"--layer", "--resolution", "--step", "--profile", "--at",
                                    "--profile-name", "--edge", "--datum", "--policy", "--max-loss"}},
      {"map",
       kAll + kWriter + kMapWriter + kHeavy +
           std::vector<std::string>{"--poses", "--from", "--from-scan", "--to-scan", "--resolution",
                                    "--profile", "--edge", "--datum", "--frame-id", "--epsg", "--ageing",
                                    "--min-unknown", "--model", "--models", "--heights", "--stats"}},
      {"compare", kAll + std::vector<std::string>{"--at", "--layout", "--reach", "--cost", "--profile",
                                                  "--every", "--poses", "--models", "--heights", "--edge",
                                                  "--motion", "--csv", "--plot", "-O, --overwrite"}},
      {"verify", kAll + kWriter + kHeavy + std::vector<std::string>{"--deep", "--recover", "--header-from"}},
      {"archive", kAll},
      {"render", kAll + kWriter + kHeavy + std::vector<std::string>{"--layer", "--scale", "--colormap"}},
  };
}

class EveryToolTest : public CliTest, public testing::WithParamInterface<ToolFlags> {
 protected:
  Outcome tool(const std::vector<std::string>& arguments) const {
    return CliTest::tool(GetParam().verb, arguments);
  }
  std::string name() const { return "apgm-" + GetParam().verb; }
};

TEST_P(EveryToolTest, HelpNamesEveryFlagOfTheContract) {
  const Outcome outcome = tool({"--help"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_EQ(outcome.err, "");
  for (const std::string& flag : GetParam().flags) EXPECT_THAT(outcome.out, HasSubstr(flag));
  EXPECT_THAT(outcome.out, HasSubstr("\nExamples:\n"));
  EXPECT_THAT(outcome.out, HasSubstr("\nExit codes:\n"));
}

TEST_P(EveryToolTest, HelpFitsAHundredColumns) {
  const std::string text = tool({"-h"}).out;
  for (std::size_t from = 0; from < text.size();) {
    const std::size_t end = text.find('\n', from);
    EXPECT_LE(end - from, 100u) << text.substr(from, end - from);
    from = end + 1;
  }
}

TEST_P(EveryToolTest, HelpComesBeforeAnyComplaint) {
  EXPECT_EQ(tool({"--bogus", "--help", "missing.apgm"}).code, 0);
}

TEST_P(EveryToolTest, VersionNamesFormatAndLibraries) {
  const Outcome outcome = tool({"-V"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(
      outcome.out,
      testing::MatchesRegex(name() + " [0-9.]+ \\(format 1\\.0, archives 1\\.1, zstd 1[0-9.]+, FlatBuffers "
                                     "2[0-9.]+\\)\n"));
  const Json document = Json::parse(tool({"--version", "--json"}).out);
  EXPECT_EQ(document["format_version"], "1.0");
  EXPECT_EQ(document["archive_format_version"], "1.1");
  EXPECT_EQ(document["tool"], name());
}

TEST_P(EveryToolTest, UnknownOptionIsAUsageErrorWithASuggestion) {
  expect_failure(tool({"--verbos", "a.apgm"}), 2, name() + ": error: unknown option '--verbos'",
                 "did you mean '--verbose'?");
  expect_failure(tool({"--zzzzzzzzzz", "a.apgm"}), 2, "unknown option '--zzzzzzzzzz'",
                 "--help lists the options");
  expect_failure(tool({"-z", "a.apgm"}), 2, "unknown option '-z'");
}

TEST_P(EveryToolTest, ANumberBelowZeroIsNoMistypedOption) {
  expect_failure(tool({"a.apgm", "-1"}), 2, "unknown option '-1'",
                 "a number below 0 is only taken as the value of an option");
}

TEST_P(EveryToolTest, NoArgumentsIsAUsageError) { expect_failure(tool({}), 2, "no input is given"); }

TEST_P(EveryToolTest, QuietAndVerboseExcludeEachOther) {
  expect_failure(tool({"-q", "-v", "a.apgm"}), 2, "-q and -v exclude each other");
}

TEST_P(EveryToolTest, BadColorIsAUsageError) {
  expect_failure(tool({"--color", "alwys", "a.apgm"}), 2,
                 "--color takes one of auto, always, never; not 'alwys'", "did you mean 'always'?");
}

TEST_P(EveryToolTest, UsageErrorIsAJsonDocument) {
  const Outcome outcome = tool({"--bogus", "--json"});
  EXPECT_EQ(outcome.code, 2);
  const Json document = Json::parse(outcome.out);
  EXPECT_EQ(document["schema"], "apgm." + GetParam().verb + "/1");
  EXPECT_EQ(document["error"]["code"], "invalid_argument");
  EXPECT_EQ(document["error"]["message"], "unknown option '--bogus'");
  EXPECT_TRUE(document["error"]["hint"].is_string());
  EXPECT_TRUE(document["error"]["path"].is_null());
  EXPECT_TRUE(document["error"]["offset_bytes"].is_null());
}

TEST_P(EveryToolTest, HelpOnAFullDiskFails) {
  Launch launch;
  launch.output = "/dev/full";
  const Outcome outcome = CliTest::tool(GetParam().verb, {"--help"}, launch);
  EXPECT_EQ(outcome.code, 5);
  EXPECT_THAT(outcome.err, HasSubstr("cannot write to standard output: No space left on device"));
}

TEST_P(EveryToolTest, HelpIntoAClosedPipeIsQuiet) {
  Launch launch;
  launch.output_pipe_closed = true;
  const Outcome outcome = CliTest::tool(GetParam().verb, {"--help"}, launch);
  EXPECT_EQ(outcome.code, 141);
  EXPECT_EQ(outcome.err, "");
}

TEST_P(EveryToolTest, MissingValueIsAUsageError) {
  expect_failure(tool({"a.apgm", "--color"}), 2, "--color needs a value");
  expect_failure(tool({"--color=", "a.apgm"}), 2, "--color needs a value");
}

TEST_P(EveryToolTest, TheFrontRunsIt) {
  const Outcome direct = tool({"--help"});
  const Outcome front = CliTest::tool("", {GetParam().verb, "--help"});
  EXPECT_EQ(front.code, direct.code);
  EXPECT_EQ(front.out, direct.out);
  EXPECT_EQ(CliTest::tool("", {"help", GetParam().verb}).out, direct.out);
  EXPECT_THAT(CliTest::tool("", {"--help"}).out, HasSubstr("  " + GetParam().verb + " "));
}

TEST_P(EveryToolTest, ItsPageIsCurrent) {
  const std::string page = read_file(std::string(APGM_SOURCE_DIR) + "/docs/cli/" + name() + ".md");
  const std::string help = tool({"--help"}).out;
  EXPECT_THAT(page, HasSubstr("```text\n" + help + "```\n")) << "run the target cli_docs";
}

TEST_F(CliTest, ThePageOfArchivesTellsEachCommand) {
  const std::string page = read_file(std::string(APGM_SOURCE_DIR) + "/docs/cli/apgm-archive.md");
  for (const std::string command : {"commit", "log", "checkout", "compact", "tag"}) {
    const std::string help = CliTest::tool("archive", {command, "--help"}).out;
    EXPECT_THAT(page, HasSubstr("## apgm-archive " + command + "\n\n```text\n" + help + "```\n"))
        << "run the target cli_docs";
  }
}

INSTANTIATE_TEST_SUITE_P(Tools, EveryToolTest, testing::ValuesIn(all_tools()),
                         [](const auto& tool) { return tool.param.verb; });

/// Tools that read one or more .apgm files: what they need to get as far as reading.
class EveryReaderTest : public CliTest, public testing::WithParamInterface<std::string> {
 protected:
  Outcome read(const std::string& input, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments{input};
    if (GetParam() == "diff") arguments.push_back(input);
    const bool writes = GetParam() != "info" && GetParam() != "compare" && GetParam() != "diff";
    if (writes) arguments.insert(arguments.end(), {"-o", output()});
    if (GetParam() == "crop") arguments.insert(arguments.end(), {"--bbox", "0,0,5,5"});
    if (GetParam() == "resample") arguments.insert(arguments.end(), {"--step", "2"});
    arguments.insert(arguments.end(), more.begin(), more.end());
    return tool(GetParam(), arguments);
  }
  std::string output() const { return GetParam() == "render" ? "out.png" : "out.apgm"; }
  /// The failure, and that it left nothing.
  void expect_refused(const std::string& input, int code, const std::string& message,
                      const std::string& hint = "") const {
    const std::set<std::string> before = files();
    expect_failure(read(input), code, message, hint);
    EXPECT_EQ(files(), before);
  }
};

TEST_P(EveryReaderTest, MissingInput) {
  expect_refused("gone.apgm", 4, "cannot open 'gone.apgm': No such file or directory");
}

TEST_P(EveryReaderTest, DirectoryAsInput) { expect_refused(".", 4, "'.'"); }

TEST_P(EveryReaderTest, EmptyFile) {
  put("empty.apgm", "");
  expect_refused("empty.apgm", 4, "'empty.apgm' is not an apgm file: it is empty",
                 "nothing was written to it, or all of it was lost");
}

TEST_P(EveryReaderTest, ForeignFileIsNamed) {
  put("a.apgm", "\x89PNG\r\n\x1a\n and more");
  expect_refused("a.apgm", 4, "'a.apgm' is not an apgm file: starts with 89 50 4e 47 (PNG image)",
                 "apgm-convert reads: octomap, map_server");
}

TEST_P(EveryReaderTest, TruncatedFile) {
  write_random("a.apgm", 1);
  const std::string whole = bytes("a.apgm");
  put("cut.apgm", whole.substr(0, whole.size() - 9));
  expect_refused("cut.apgm", 4, "'cut.apgm' is damaged");
  put("head.apgm", whole.substr(0, 20));
  expect_refused("head.apgm", 4, "'head.apgm' is damaged");
}

TEST_P(EveryReaderTest, DamagedHeaderIsAJsonDocument) {
  write_random("a.apgm", 1);
  std::string content = bytes("a.apgm");
  content[20] = static_cast<char>(content[20] ^ 1);
  put("a.apgm", content);
  const Outcome outcome = read("a.apgm", {"--json"});
  EXPECT_EQ(outcome.code, 4);
  const Json error = Json::parse(outcome.out)["error"];
  EXPECT_EQ(error["code"], "damaged");
  EXPECT_EQ(error["path"], "a.apgm");
  EXPECT_TRUE(error["offset_bytes"].is_number());
}

/// Tools that take --layer.
class EveryFilterTest : public EveryReaderTest {};

TEST_P(EveryFilterTest, UnknownLayerIsNamedWithTheKnown) {
  write("a.apgm", plain_map(2, 2));
  expect_failure(read("a.apgm", {"--layer", "ocupancy"}), 2, "no layer 'ocupancy'", "occupancy");
  EXPECT_FALSE(exists(output()));
}

INSTANTIATE_TEST_SUITE_P(Tools, EveryReaderTest,
                         testing::Values("info", "convert", "merge", "crop", "diff", "resample", "compare",
                                         "render"),
                         [](const auto& verb) { return verb.param; });
INSTANTIATE_TEST_SUITE_P(Tools, EveryFilterTest,
                         testing::Values("info", "convert", "crop", "resample", "render"),
                         [](const auto& verb) { return verb.param; });

/// Tools that write a file.
class EveryWriterTest : public CliTest, public testing::WithParamInterface<std::string> {
 protected:
  void SetUp() override { write("a.apgm", plain_map(2, 2)); }

  Outcome write_to(const std::vector<std::string>& more, Launch launch = {}) const {
    std::vector<std::string> arguments{"a.apgm"};
    if (GetParam() == "crop") arguments.insert(arguments.end(), {"--bbox", "0,0,5,5"});
    if (GetParam() == "resample") arguments.insert(arguments.end(), {"--step", "2"});
    arguments.insert(arguments.end(), more.begin(), more.end());
    return tool(GetParam(), arguments, launch);
  }
  std::string output() const { return GetParam() == "render" ? "out.png" : "out.apgm"; }
};

TEST_P(EveryWriterTest, SuccessIsSilent) {
  expect_silent(write_to({"-o", output()}));
  EXPECT_TRUE(exists(output()));
  EXPECT_EQ(files(), (std::set<std::string>{"a.apgm", output()}));
}

TEST_P(EveryWriterTest, VerboseTellsStepsAndMemory) {
  const Outcome outcome = write_to({"-v", "-o", output()});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_EQ(outcome.out, "");
  EXPECT_THAT(outcome.err, HasSubstr("wrote '" + output() + "'"));
  EXPECT_THAT(outcome.err, HasSubstr("peak memory"));
}

TEST_P(EveryWriterTest, MissingOutputIsAUsageError) {
  const std::string before = bytes("a.apgm");
  expect_failure(write_to({}), 2, "no output is given", "-o FILE");
  EXPECT_EQ(bytes("a.apgm"), before);
}

TEST_P(EveryWriterTest, AnOptionIsNotAnOutput) {
  expect_failure(write_to({"-o", "-n"}), 2, "--output needs a value, but is followed by -n");
  EXPECT_EQ(files(), (std::set<std::string>{"a.apgm"}));
}

TEST_P(EveryWriterTest, ExistingOutputIsKept) {
  put(output(), "precious");
  expect_failure(write_to({"-o", output()}), 5, "output '" + output() + "' already exists",
                 "pass --overwrite to replace it");
  EXPECT_EQ(bytes(output()), "precious");
}

TEST_P(EveryWriterTest, OverwriteReplacesWithTheSameBytes) {
  ASSERT_EQ(write_to({"-o", output()}).code, 0);
  const std::string fresh = bytes(output());
  put(output(), "old");
  expect_silent(write_to({"-O", "-o", output()}));
  EXPECT_EQ(bytes(output()), fresh);
}

TEST_P(EveryWriterTest, OutputThatIsTheInputIsRefused) {
  const std::string before = bytes("a.apgm");
  expect_failure(write_to({"-O", "-o", "a.apgm"}), 2, "output 'a.apgm' is the input 'a.apgm'");
  std::filesystem::create_symlink("a.apgm", path("link.apgm"));
  expect_failure(write_to({"-O", "-o", "link.apgm"}), 2, "is the input");
  std::filesystem::create_hard_link(path("a.apgm"), path("hard.apgm"));
  expect_failure(write_to({"-O", "-o", "./hard.apgm"}), 2, "is the input");
  EXPECT_EQ(bytes("a.apgm"), before);
}

TEST_P(EveryWriterTest, DirectoryAsOutput) {
  std::filesystem::create_directory(path("d.apgm"));
  expect_failure(write_to({"-O", "-o", "d.apgm", "--dry-run"}), 5, "output 'd.apgm' is a directory");
}

TEST_P(EveryWriterTest, MissingDirectoryOfTheOutput) {
  expect_failure(write_to({"-o", "no/" + output()}), 5, "directory 'no': No such file or directory",
                 "create the directory 'no' first");
}

TEST_P(EveryWriterTest, ADirectoryThatCannotBeWritten) {
  if (::geteuid() == 0) {
    // The super-user may write everywhere but here.
    expect_failure(write_to({"-o", "/proc/" + output()}), 5, "/proc/" + output());
    return;
  }
  std::filesystem::create_directory(path("locked"));
  std::filesystem::permissions(path("locked"),
                               std::filesystem::perms::owner_read | std::filesystem::perms::owner_exec);
  expect_failure(write_to({"-o", "locked/" + output()}), 5, "Permission denied");
}

TEST_P(EveryWriterTest, FullDisk) {
  const std::string device = GetParam() == "convert" ? "--to=apgm" : "-q";
  expect_failure(write_to({"-o", "/dev/full", device}), 5, "No space left on device");
}

TEST_P(EveryWriterTest, StandardOutputOnAFullDisk) {
  Launch launch;
  launch.output = "/dev/full";
  expect_failure(write_to({"-o", "-"}, launch), 5, "No space left on device");
}

TEST_P(EveryWriterTest, StandardOutputThatNobodyReads) {
  Launch launch;
  launch.output_pipe_closed = true;
  const Outcome outcome = write_to({"-o", "-"}, launch);
  EXPECT_EQ(outcome.code, 141);
  EXPECT_EQ(outcome.err, "");
}

TEST_P(EveryWriterTest, StandardOutputCarriesTheFile) {
  ASSERT_EQ(write_to({"-o", output()}).code, 0);
  const Outcome outcome = write_to({"-o", "-"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_EQ(outcome.out, bytes(output()));
}

TEST_P(EveryWriterTest, JsonAndStandardOutputExcludeEachOther) {
  const Outcome outcome = write_to({"--json", "-o", "-"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_EQ(Json::parse(outcome.out)["error"]["code"], "invalid_argument");
}

TEST_P(EveryWriterTest, DryRunWritesNothing) {
  expect_silent(write_to({"-n", "-o", output()}));
  EXPECT_EQ(files(), (std::set<std::string>{"a.apgm"}));
  const Json document = Json::parse(write_to({"-n", "--json", "-o", output()}).out);
  EXPECT_EQ(document["dry_run"], true);
  EXPECT_EQ(document["output"], output());
}

TEST_P(EveryWriterTest, DryRunStillChecksTheInput) {
  put("b.apgm", "nothing");
  std::vector<std::string> arguments{"-n", "b.apgm", "-o", output()};
  if (GetParam() == "crop") arguments.insert(arguments.end(), {"--bbox", "0,0,5,5"});
  if (GetParam() == "resample") arguments.insert(arguments.end(), {"--step", "2"});
  expect_failure(tool(GetParam(), arguments), 4, "'b.apgm' is not an apgm file");
}

TEST_P(EveryWriterTest, ResultIsAJsonDocument) {
  const Outcome outcome = write_to({"--json", "-o", output()});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_EQ(outcome.err, "");
  const Json document = Json::parse(outcome.out);
  EXPECT_EQ(document["schema"], "apgm." + GetParam() + "/1");
  EXPECT_EQ(document["output"], output());
  EXPECT_FALSE(document.contains("error"));
  EXPECT_EQ(document["losses"], Json::array());
}

TEST_P(EveryWriterTest, BadThreadsAndMemoryAreRefused) {
  expect_failure(write_to({"-o", output(), "-j", "two"}), 2,
                 "--threads takes a whole number from 0 to 1024, not 'two'");
  expect_failure(write_to({"-o", output(), "-j", "-1"}), 2,
                 "--threads takes a whole number from 0 to 1024, not '-1'");
  expect_failure(write_to({"-o", output(), "--max-memory", "12 parsecs"}), 2,
                 "--max-memory takes a size such as");
  expect_failure(write_to({"-o", output(), "--progress", "--no-progress"}), 2, "exclude each other");
  EXPECT_FALSE(exists(output()));
}

TEST_P(EveryWriterTest, OptionGivenTwice) {
  expect_failure(write_to({"-o", output(), "-o", "b"}), 2, "--output is given twice");
}

INSTANTIATE_TEST_SUITE_P(Tools, EveryWriterTest,
                         testing::Values("convert", "merge", "crop", "resample", "render"),
                         [](const auto& verb) { return verb.param; });

/// Tools that write .apgm files.
class EveryMapWriterTest : public EveryWriterTest {};

TEST_P(EveryMapWriterTest, JsonTellsWhatWasWritten) {
  const Json document = Json::parse(write_to({"--json", "-o", "out.apgm"}).out);
  const Json written = info("out.apgm");
  EXPECT_EQ(document["content_id"], written["map"]["content_id"]);
  EXPECT_EQ(document["patches"], written["map"]["patches"]);
  EXPECT_EQ(document["bytes"], bytes("out.apgm").size());
}

TEST_P(EveryMapWriterTest, BadWritingOptionsAreRefused) {
  const auto refused = [&](const std::vector<std::string>& options, const std::string& message) {
    std::vector<std::string> arguments{"-o", "out.apgm"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    expect_failure(write_to(arguments), 2, message);
  };
  refused({"--level", "0"}, "--level takes a whole number from 1 to 19, not '0'");
  refused({"--level", "20"}, "--level takes a whole number from 1 to 19, not '20'");
  refused({"--level", "3.0"}, "--level takes a whole number from 1 to 19, not '3.0'");
  refused({"--lossy", "u32"}, "--lossy takes one of u16, u8; not 'u32'");
  refused({"--stamp", "yesterday"}, "--stamp takes a time such as 2026-01-31T12:00:00Z");
  refused({"--stamp", "2026-02-30T12:00:00Z"}, "--stamp takes a time");
  EXPECT_FALSE(exists("out.apgm"));
}

TEST_P(EveryMapWriterTest, HistoryNamesTheOperationAndHoldsNoPath) {
  ASSERT_EQ(write_to({"-o", "out.apgm"}).code, 0);
  const Json history = info("out.apgm", {"--history"})["history"];
  ASSERT_EQ(history.size(), 1u);
  EXPECT_EQ(history[0]["operation"], GetParam());
  EXPECT_EQ(history[0]["inputs"][0], info("a.apgm")["map"]["content_id"]);
  EXPECT_TRUE(history[0]["parameters"].is_object());
  EXPECT_EQ(bytes("out.apgm").find(directory_.path()), std::string::npos);
}

TEST_P(EveryMapWriterTest, NoProvenanceLeavesNoHistory) {
  ASSERT_EQ(write_to({"--no-provenance", "-o", "out.apgm"}).code, 0);
  EXPECT_EQ(info("out.apgm", {"--history"})["history"], Json::array());
}

TEST_P(EveryMapWriterTest, StampIsStoredOnlyWhenAskedFor) {
  ASSERT_EQ(write_to({"-o", "out.apgm"}).code, 0);
  EXPECT_TRUE(info("out.apgm")["map"]["stamp_ns"].is_null());
  ASSERT_EQ(write_to({"-O", "--stamp", "2026-01-31T12:00:00Z", "-o", "out.apgm"}).code, 0);
  EXPECT_EQ(info("out.apgm")["map"]["stamp_ns"], 1'769'860'800'000'000'000);
  expect_failure(write_to({"-O", "--stamp", "@0", "-o", "out.apgm"}), 2, "cannot hold the time 0",
                 "leave --stamp out");
}

TEST_P(EveryMapWriterTest, EmptyResultIsAMapAndSaysSo) {
  write("a.apgm", empty_map());
  const Outcome outcome = write_to({"-o", "out.apgm"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("note: the result holds no patches\n"));
  EXPECT_EQ(info("out.apgm")["map"]["patches"], 0);
  EXPECT_EQ(write_to({"-q", "-O", "-o", "out.apgm"}).err, "");
}

TEST_P(EveryMapWriterTest, FromStandardInput) {
  ASSERT_EQ(write_to({"-o", "out.apgm"}).code, 0);
  Launch launch;
  launch.input = path("a.apgm");
  std::vector<std::string> arguments{"-", "-o", "b.apgm"};
  if (GetParam() == "crop") arguments.insert(arguments.end(), {"--bbox", "0,0,5,5"});
  if (GetParam() == "resample") arguments.insert(arguments.end(), {"--step", "2"});
  expect_silent(tool(GetParam(), arguments, launch));
  EXPECT_EQ(bytes("b.apgm"), bytes("out.apgm"));
}

INSTANTIATE_TEST_SUITE_P(Tools, EveryMapWriterTest, testing::Values("convert", "merge", "crop", "resample"),
                         [](const auto& verb) { return verb.param; });

}  // namespace
}  // namespace apgm::test
