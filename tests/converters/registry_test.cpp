#include "tests/converters/support.hpp"

namespace apgm::converters {
namespace {

TEST(Registry, FindsByNameContentAndExtension) {
  const testing::TempDir dir;
  for (const Converter* converter : all()) EXPECT_EQ(find(converter->name()), converter);
  EXPECT_EQ(find("nothing"), nullptr);
  EXPECT_EQ(sniff(dir / "missing"), nullptr);
  EXPECT_EQ(sniff(testing::write_text(dir / "empty.bt", "")), nullptr);
  EXPECT_EQ(sniff(testing::write_text(dir / "png", "\x89PNG\r\n\x1a\n")), nullptr);
  EXPECT_EQ(for_extension("a.txt"), nullptr);
}

TEST(Registry, ContentDecidesNotTheName) {
  if (find("octomap") == nullptr || find("map_server") == nullptr) GTEST_SKIP() << "a converter is not built";
  const testing::TempDir dir;
  EXPECT_EQ(sniff(testing::write_text(dir / "a.yaml", "# Octomap OcTree binary file\n")), find("octomap"));
  EXPECT_EQ(sniff(testing::write_text(dir / "b.bt", "image: a.pgm\nresolution: 1\n")), find("map_server"));
  EXPECT_EQ(sniff(testing::write_text(dir / "c.yaml", "images: 1\nmy_resolution: 2\n")), nullptr);
  EXPECT_EQ(for_extension("x/y.BT"), find("octomap"));
  EXPECT_EQ(for_extension("y.yml"), find("map_server"));
}

TEST(Registry, EveryConverterDescribesItself) {
  for (const Converter* converter : all()) {
    EXPECT_FALSE(converter->description().empty());
    EXPECT_FALSE(converter->losses().empty());
    for (const char* key : {"datum", "edge_m", "frame_id", "epsg"}) {
      const auto specs = converter->settings();
      EXPECT_TRUE(std::ranges::any_of(specs, [&](const auto& s) { return s.key == key && s.for_reading; }));
    }
  }
}

}  // namespace
}  // namespace apgm::converters
