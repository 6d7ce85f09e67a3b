// The library's reader against the frozen files of every version of the format (docs/conformance.md).

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

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

std::vector<fs::path> files_in(const fs::path& dir) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(dir)) {
    if (entry.path().extension() == ".apgm") files.push_back(entry.path());
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

TEST(ConformanceTest, Sha256OfTheStandardsExamples) {
  EXPECT_EQ(sha256(std::as_bytes(std::span("abc", 3))),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256({}), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

}  // namespace
}  // namespace apgm::test
