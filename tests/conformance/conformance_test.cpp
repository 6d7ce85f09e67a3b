// The library's reader against the frozen files of every version of the format (docs/conformance.md).

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "apgm/core/error.hpp"
#include "apgm/format/verify.hpp"
#include "dump.hpp"
#include "sha256.hpp"

namespace apgm::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

json read_json(const fs::path& path) {
  std::ifstream in(path);
  return json::parse(in);
}

std::vector<fs::path> files_in(const fs::path& dir, const char* extension = ".apgm") {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(dir)) {
    if (entry.path().extension() == extension) files.push_back(entry.path());
  }
  std::ranges::sort(files);
  return files;
}

const fs::path kCorpus = APGM_CORPUS_DIR;

TEST(ConformanceTest, GoodFilesHoldWhatIsExpected) {
  const auto files = files_in(kCorpus / "good");
  ASSERT_GE(files.size(), 30u);
  for (fs::path path : files) {
    const json found = result_of(path.string());
    EXPECT_EQ(found, read_json(path.replace_extension(".json"))) << path;
  }
}

TEST(ConformanceTest, ContentIdDoesNotDependOnCompression) {
  const auto id = [](const char* name) { return result_of(kCorpus / "good" / name)["content_id"]; };
  EXPECT_EQ(id("mixed.apgm"), id("mixed_level_19.apgm"));
  EXPECT_NE(id("mixed.apgm"), id("mixed_lossy.apgm"));
}

TEST(ConformanceTest, BadFilesAreRefusedAsExpected) {
  const auto files = files_in(kCorpus / "bad");
  const json expected = read_json(kCorpus / "bad" / "expected.json");
  ASSERT_GE(files.size(), 200u);
  EXPECT_EQ(files.size(), expected.size());
  for (const fs::path& path : files) {
    const json& line = expected.at(path.stem().string());
    const json found = result_of(path.string());
    if (line["by"] == "verification") {
      // A reader that does not look at the whole file may not notice.
      EXPECT_TRUE(!found.contains("refused") || found["refused"] == line["refused"]) << path << found;
      continue;
    }
    EXPECT_EQ(found.value("refused", "not"), line["refused"]) << path << ": " << line["rule"];
  }
}

TEST(ConformanceTest, GoodArchivesHoldWhatIsExpected) {
  const auto files = files_in(kCorpus / "archives" / "good");
  ASSERT_GE(files.size(), 25u);
  for (fs::path path : files) {
    const json found = result_of_archive(path.string());
    EXPECT_EQ(found, read_json(path.replace_extension(".json"))) << path;
  }
}

TEST(ConformanceTest, BadArchivesAreRefusedAsExpected) {
  const auto files = files_in(kCorpus / "archives" / "bad");
  const json expected = read_json(kCorpus / "archives" / "bad" / "expected.json");
  ASSERT_GE(files.size(), 70u);
  EXPECT_EQ(files.size(), expected.size());
  for (const fs::path& path : files) {
    const json& line = expected.at(path.stem().string());
    const std::string last = result_of(path.string()).value("refused", "not");
    const std::string all = result_of_archive(path.string()).value("refused", "not");
    EXPECT_EQ(last, line["by"] == "reading" ? line["refused"] : "not") << path << ": " << line["rule"];
    EXPECT_EQ(all, line["by"] == "verification" ? "not" : line["refused"]) << path << ": " << line["rule"];
  }
}

TEST(ConformanceTest, StreamsAreReceivedAsExpected) {
  for (const char* folder : {"good", "lossy"}) {
    const auto files = files_in(kCorpus / "streams" / folder, ".apgms");
    ASSERT_GE(files.size(), 15u);
    for (fs::path path : files) {
      const json found = dump_stream(path.string());
      json expected = read_json(path.replace_extension(".json"));
      expected.erase("rule");
      EXPECT_EQ(found, expected) << path;
      if (folder == std::string("good")) {
        EXPECT_TRUE(found["complete"]) << path;
      }
    }
  }
}

/// "", or as what verification refuses a file; in `text` what it says.
std::string verified(const fs::path& path, bool deep, std::string& text) {
  VerifyOptions options;
  options.deep = deep;
  try {
    const VerifyReport report = verify(path.string(), options);
    for (const Problem& problem : report.problems) text += problem.text + "; ";
    return report.valid() ? "" : "damaged";
  } catch (const Error& e) {
    text = e.message();
    return to_string(e.code());
  }
}

TEST(ConformanceTest, VerificationFindsNothingInGoodFiles) {
  for (const fs::path& path : files_in(kCorpus / "good")) {
    std::string text;
    EXPECT_EQ(verified(path, true, text), "") << path << ": " << text;
  }
}

TEST(ConformanceTest, VerificationFindsAllBadFiles) {
  const json expected = read_json(kCorpus / "bad" / "expected.json");
  std::size_t only_by_verification = 0;
  for (const fs::path& path : files_in(kCorpus / "bad")) {
    const json& line = expected.at(path.stem().string());
    std::string text;
    EXPECT_EQ(verified(path, true, text), line["refused"]) << path << ": " << line["rule"] << ": " << text;
    if (line["by"] != "verification") continue;
    ++only_by_verification;
    EXPECT_EQ(verified(path, false, text), line["refused"]) << path << ": " << line["rule"] << ": " << text;
  }
  EXPECT_GE(only_by_verification, 14u);
}

TEST(ConformanceTest, VerificationFindsNothingButTornEndsInGoodArchives) {
  for (fs::path path : files_in(kCorpus / "archives" / "good")) {
    std::string text;
    const std::string found = verified(path, true, text);
    const json expected = read_json(path.replace_extension(".json"));
    EXPECT_EQ(found, expected["uncommitted_bytes"] == 0 ? "" : "damaged") << path << ": " << text;
    EXPECT_EQ(text, "") << path;
  }
}

TEST(ConformanceTest, VerificationFindsAllBadArchives) {
  const json expected = read_json(kCorpus / "archives" / "bad" / "expected.json");
  for (const fs::path& path : files_in(kCorpus / "archives" / "bad")) {
    const json& line = expected.at(path.stem().string());
    std::string text;
    EXPECT_EQ(verified(path, true, text), line["refused"]) << path << ": " << line["rule"] << ": " << text;
  }
}

TEST(ConformanceTest, Sha256OfTheStandardsExamples) {
  EXPECT_EQ(sha256(std::as_bytes(std::span("abc", 3))),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256({}), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

}  // namespace
}  // namespace apgm::test
