#include <limits>
#include <random>

#include "tests/converters/octomap_support.hpp"

namespace apgm::converters {
namespace {

using testing::open;

using testing::error_of;
using ::testing::HasSubstr;
using testing::node;
using testing::tree_file;

/// Opening must fail with one of the codes for bad files and leave standard error silent.
Error open_bad(const std::string& bytes) {
  const testing::TempDir dir;
  const std::string path = testing::write_text(dir / "bad", bytes);
  ::testing::internal::CaptureStderr();
  const Error error = error_of([&] { open(octomap(), path); });
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(error.path(), path);
  return error;
}

std::string good_file(bool binary) {
  const testing::TempDir dir;
  ::octomap::OcTree tree(0.1);
  for (int i = 0; i < 12; ++i) tree.setNodeValue(testing::key(i, 3 * i, -i), i % 2 == 0 ? 3.5f : -2.0f);
  tree.updateInnerOccupancy();
  EXPECT_TRUE(binary ? tree.writeBinary(dir / "a") : tree.write(dir / "a"));
  return testing::read_text(dir / "a");
}

TEST(OctomapBadInput, MissingFileIsUnreadable) {
  const Error error = error_of([] { open(octomap(), "/nonexistent/a.bt"); });
  EXPECT_EQ(error.code(), ErrorCode::kUnreadable);
  EXPECT_EQ(error_of([] { open(octomap(), "/tmp"); }).code(), ErrorCode::kUnreadable);
}

TEST(OctomapBadInput, OtherFilesAreForeign) {
  EXPECT_EQ(open_bad("").code(), ErrorCode::kForeign);
  EXPECT_EQ(open_bad("\x89PNG\r\n\x1a\n").code(), ErrorCode::kForeign);
}

TEST(OctomapBadInput, EveryTruncationIsTold) {
  for (const bool binary : {false, true}) {
    const std::string good = good_file(binary);
    for (std::size_t n = 0; n < good.size(); ++n) {
      const Error error = open_bad(good.substr(0, n));
      EXPECT_TRUE(error.code() == ErrorCode::kDamaged || error.code() == ErrorCode::kForeign) << n;
    }
    EXPECT_THAT(open_bad(good + "x").message(), HasSubstr("data follow"));
  }
}

TEST(OctomapBadInput, BitFlipsNeverCrash) {
  const testing::TempDir dir;
  for (const bool binary : {false, true}) {
    const std::string good = good_file(binary);
    for (std::size_t bit = 0; bit < good.size() * 8; bit += 3) {
      std::string bytes = good;
      bytes[bit / 8] = static_cast<char>(bytes[bit / 8] ^ (1 << (bit % 8)));
      const std::string path = testing::write_text(dir / "flip", bytes);
      try {
        open(octomap(), path);
      } catch (const Error& error) {
        EXPECT_EQ(error.path(), path);
      }
    }
  }
}

TEST(OctomapBadInput, TreesDeeperThanSixteenLevelsAreRefused) {
  std::string chain;  // 200 000 levels: enough to overflow a stack that follows them
  for (int i = 0; i < 200'000; ++i) chain += node(1, 1);
  EXPECT_THAT(open_bad(tree_file(false, chain + node(1, 0), 200'001)).message(), HasSubstr("deeper than 16"));
  std::string inner;
  for (int i = 0; i < 200'000; ++i) inner += std::string("\x03\0", 2);
  EXPECT_THAT(open_bad(tree_file(true, inner + std::string("\x01\0", 2), 200'002)).message(),
              HasSubstr("deeper than 16"));
}

TEST(OctomapBadInput, SixteenLevelsAreRead) {
  const testing::TempDir dir;
  std::string chain, inner;
  for (int i = 0; i < 16; ++i) chain += node(1, 1);
  for (int i = 0; i < 15; ++i) inner += std::string("\x03\0", 2);
  const auto full = testing::write_text(dir / "a.ot", tree_file(false, chain + node(1, 0), 17));
  EXPECT_EQ(open(octomap(), full)->summary().patches, 1u);
  const auto binary =
      testing::write_text(dir / "a.bt", tree_file(true, inner + std::string("\x01\0", 2), 17));
  EXPECT_EQ(open(octomap(), binary)->summary().patches, 1u);
}

TEST(OctomapBadInput, HeadersAreChecked) {
  const std::string nodes = node(1, 0);
  for (const char* res : {"0", "-1", "nan", "inf", "1e300", "1e-300", "abc", ""}) {
    EXPECT_EQ(open_bad(tree_file(false, nodes, 1, res)).code(), ErrorCode::kDamaged) << res;
  }
  EXPECT_THAT(open_bad(tree_file(false, nodes, 2)).message(), HasSubstr("1 nodes, its header says 2"));
  EXPECT_EQ(open_bad("# Octomap OcTree file\nid OcTree\nsize 1\ndata\n" + nodes).code(), ErrorCode::kDamaged);
  EXPECT_EQ(open_bad("# Octomap OcTree file\nid OcTree\nsize -1\nres 1\ndata\n" + nodes).code(),
            ErrorCode::kDamaged);
}

TEST(OctomapBadInput, OtherTreesAreUnsupported) {
  const Error error = open_bad(tree_file(false, node(1, 0), 1, "0.1", "ColorOcTree"));
  EXPECT_EQ(error.code(), ErrorCode::kUnsupported);
  EXPECT_THAT(error.message(), HasSubstr("ColorOcTree"));
  EXPECT_FALSE(error.hint().empty());
}

TEST(OctomapBadInput, NodesThatAreNotNumbersAreRefused) {
  EXPECT_THAT(open_bad(tree_file(false, node(std::numeric_limits<float>::quiet_NaN(), 0), 1)).message(),
              HasSubstr("not a number"));
}

TEST(OctomapBadInput, SettingsAreCheckedBeforeTheFile) {
  for (const Settings& bad :
       {Settings{{"mode", "3d"}}, Settings{{"z_min", "1"}, {"z_max", "1"}}, Settings{{"edge_m", "-1"}},
        Settings{{"nonsense", "1"}}, Settings{{"origin", "0,0"}}}) {
    EXPECT_EQ(error_of([&] { open(octomap(), "/nonexistent", bad); }).code(), ErrorCode::kInvalidArgument);
  }
}

TEST(OctomapBadInput, TreesAboveTheBudgetAreRefused) {
  const testing::TempDir dir;
  // A root with eight leaves.
  std::string nodes = testing::node(1, 0xff);
  for (int i = 0; i < 8; ++i) nodes += testing::node(1, 0);
  const auto path = testing::write_text(dir / "a.ot", testing::tree_file(false, nodes, 9));
  const auto bytes = std::filesystem::file_size(path);
  constexpr std::uint64_t tree = 9 * 32 + 80;  // nodes, and the list of the root's children
  for (const std::uint64_t budget : {std::uint64_t{1}, bytes + tree - 1}) {
    const Error error = testing::error_of([&] { octomap().open({path, {}, {}, budget}); });
    EXPECT_EQ(error.code(), ErrorCode::kLimit);
    EXPECT_THAT(error.hint(), ::testing::HasSubstr("allow at least 1 MiB"));
  }
  // Each leaf covers 256 x 256 patches, and what they cover is listed.
  const Error list = testing::error_of([&] { octomap().open({path, {}, {}, bytes + tree}); });
  EXPECT_THAT(list.message(), ::testing::HasSubstr("the list of 262144 patches"));
  EXPECT_THAT(list.hint(), ::testing::HasSubstr("allow at least 7 MiB"));
  EXPECT_NE(octomap().open({path, {}, {}, std::uint64_t{8} << 20}), nullptr);
}

TEST(OctomapBadInput, AForeignTypeIsEscaped) {
  const testing::TempDir dir;
  const auto path = testing::write_text(dir / "a.ot", testing::tree_file(false, "", 0, "0.1", "\xff\x1b[1m"));
  EXPECT_THAT(testing::error_of([&] {
                octomap().open({path, {}, {}});
              }).message(),
              ::testing::HasSubstr("'\\xff\\x1b[1m'"));
}

}  // namespace
}  // namespace apgm::converters
