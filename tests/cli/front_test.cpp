#include "cli_test.hpp"

namespace apgm::test {
namespace {

class FrontTest : public CliTest {};

TEST_F(FrontTest, ListsTheTools) {
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{}, {"--help"}, {"-h"}, {"help"}}) {
    const Outcome outcome = tool("", arguments);
    EXPECT_EQ(outcome.code, 0);
    EXPECT_EQ(outcome.err, "");
    for (const char* verb : {"info", "convert", "merge", "crop"}) {
      EXPECT_THAT(outcome.out, HasSubstr("\n  " + std::string(verb) + " "));
    }
  }
}

TEST_F(FrontTest, UnknownVerbIsAUsageError) {
  expect_failure(tool("", {"merg", "a"}), 2, "apgm: error: unknown verb 'merg'", "did you mean 'merge'?");
  expect_failure(tool("", {"frobnicate"}), 2, "unknown verb 'frobnicate'", "'apgm --help' lists the verbs");
}

TEST_F(FrontTest, VerbIsNotAPath) {
  expect_failure(tool("", {"/../../bin/true"}), 2, "unknown verb '/../../bin/true'");
  expect_failure(tool("", {""}), 2, "unknown verb ''");
}

TEST_F(FrontTest, UnknownOption) {
  expect_failure(tool("", {"--versio"}), 2, "unknown option '--versio'", "did you mean '--version'?");
}

TEST_F(FrontTest, PassesArgumentsOutputAndCode) {
  write("a.apgm", plain_map(2, 1));
  const Outcome direct = tool("info", {"--json", "a.apgm"});
  EXPECT_EQ(tool("", {"info", "--json", "a.apgm"}).out, direct.out);
  EXPECT_EQ(tool("", {"--json", "info", "a.apgm"}).out, direct.out);
  const Outcome failed = tool("", {"info", "gone.apgm"});
  EXPECT_EQ(failed.code, 4);
  EXPECT_EQ(failed.err, tool("info", {"gone.apgm"}).err);
}

TEST_F(FrontTest, ErrorsAreJsonDocuments) {
  const Outcome outcome = tool("", {"--json", "bogus"});
  EXPECT_EQ(outcome.code, 2);
  const Json document = Json::parse(outcome.out);
  EXPECT_EQ(document["schema"], "apgm.apgm/1");
  EXPECT_EQ(document["error"]["message"], "unknown verb 'bogus'");
}

TEST_F(FrontTest, FindsToolsInThePath) {
  write_file(path("apgm-hello"), "#!/bin/sh\necho hello \"$1\"\n");
  std::filesystem::permissions(path("apgm-hello"), std::filesystem::perms::owner_all);
  Launch launch;
  launch.environment = {"PATH=" + directory_.path() + ":/usr/bin:/bin"};
  EXPECT_EQ(tool("", {"hello", "world"}, launch).out, "hello world\n");
}

}  // namespace
}  // namespace apgm::test
