#include "tests/converters/map_server_support.hpp"

namespace apgm::converters {
namespace {

using testing::open;
using testing::write;

using ::testing::HasSubstr;
using testing::p5;
using testing::YamlText;

Error open_bad(const YamlText& yaml, const std::string& picture = p5({0, 0, 0, 0, 0, 0})) {
  const testing::TempDir dir;
  const std::string path = testing::save_map(dir, yaml, picture);
  return testing::error_of([&] { open(map_server(), path); });
}

TEST(MapServerBadInput, EachMissingKeyIsNamed) {
  const std::pair<const char*, std::string YamlText::*> keys[] = {
      {"resolution", &YamlText::resolution},
      {"origin", &YamlText::origin},
      {"negate", &YamlText::negate},
      {"occupied_thresh", &YamlText::occupied_thresh},
      {"free_thresh", &YamlText::free_thresh}};
  for (const auto& [key, member] : keys) {
    YamlText yaml;
    yaml.*member = "";
    const Error error = open_bad(yaml);
    EXPECT_EQ(error.code(), ErrorCode::kDamaged) << key;
    EXPECT_THAT(error.message(), HasSubstr("key '" + std::string(key) + "' of the map is missing"));
    EXPECT_THAT(error.message(), HasSubstr("map.yaml"));
    EXPECT_FALSE(error.hint().empty());
  }
  const testing::TempDir dir;
  const auto path = testing::write_text(dir / "a.yaml", "resolution: 1\norigin: [0, 0, 0]\n");
  EXPECT_THAT(testing::error_of([&] { open(map_server(), path); }).message(),
              HasSubstr("'image' of the map is missing"));
}

TEST(MapServerBadInput, BadValuesAreRefused) {
  const std::tuple<std::string YamlText::*, const char*, ErrorCode> cases[] = {
      {&YamlText::resolution, ".nan", ErrorCode::kDamaged},
      {&YamlText::resolution, ".inf", ErrorCode::kDamaged},
      {&YamlText::resolution, "0", ErrorCode::kDamaged},
      {&YamlText::resolution, "-0.05", ErrorCode::kDamaged},
      {&YamlText::resolution, "1e300", ErrorCode::kDamaged},
      {&YamlText::resolution, "fine", ErrorCode::kDamaged},
      {&YamlText::resolution, "[1]", ErrorCode::kDamaged},
      {&YamlText::origin, "[0, 0]", ErrorCode::kDamaged},
      {&YamlText::origin, "[0, .nan, 0]", ErrorCode::kDamaged},
      {&YamlText::origin, "[1e12, 0, 0]", ErrorCode::kDamaged},
      {&YamlText::origin, "[0, 0, 1e12]", ErrorCode::kDamaged},
      {&YamlText::negate, "maybe", ErrorCode::kDamaged},
      {&YamlText::negate, "7", ErrorCode::kDamaged},
      {&YamlText::negate, "-1", ErrorCode::kDamaged},
      {&YamlText::occupied_thresh, "1.5", ErrorCode::kDamaged},
      {&YamlText::occupied_thresh, "0.1", ErrorCode::kDamaged},
      {&YamlText::free_thresh, "-0.1", ErrorCode::kDamaged},
      {&YamlText::free_thresh, "0.9", ErrorCode::kDamaged},
      {&YamlText::mode, "quaternary", ErrorCode::kDamaged},
      {&YamlText::free_thresh, ".nan", ErrorCode::kDamaged}};
  for (const auto& [member, value, code] : cases) {
    YamlText yaml;
    yaml.*member = value;
    const Error error = open_bad(yaml);
    EXPECT_EQ(error.code(), code) << value;
    EXPECT_THAT(error.path(), HasSubstr("map.yaml")) << value;
    EXPECT_FALSE(error.hint().empty()) << value;
    if (value[0] != '[') {
      EXPECT_THAT(error.message(), HasSubstr(value));
    }
  }
}

TEST(MapServerBadInput, EqualThresholdsAreAllowed) {
  const testing::TempDir dir;
  YamlText yaml;
  yaml.occupied_thresh = yaml.free_thresh = "0.5";
  EXPECT_EQ(
      testing::collect(*open(map_server(), testing::save_map(dir, yaml, p5({0, 0, 0, 0, 0, 0})))).size(), 1u);
}

TEST(MapServerBadInput, AKeyGivenTwiceIsRefused) {
  const testing::TempDir dir;
  const auto path = testing::write_text(dir / "map.yaml", YamlText().text() + "resolution: 0.2\n");
  const Error error = testing::error_of([&] { open(map_server(), path); });
  EXPECT_EQ(error.code(), ErrorCode::kDamaged);
  EXPECT_THAT(error.message(), HasSubstr("key 'resolution' of the map is given twice: '0.1' and '0.2'"));
}

TEST(MapServerBadInput, ForeignBytesAreEscaped) {
  YamlText yaml;
  yaml.negate = "a\xff\xc3\xa9";
  EXPECT_THAT(open_bad(yaml).message(), HasSubstr("is 'a\\xff\xc3\xa9', which"));
}

TEST(MapServerBadInput, WhatIsNoMapIsTold) {
  const testing::TempDir dir;
  const auto code = [&](const std::string& text) {
    const auto path = testing::write_text(dir / "a.yaml", text);
    return testing::error_of([&] { open(map_server(), path); }).code();
  };
  EXPECT_EQ(code(""), ErrorCode::kForeign);
  EXPECT_EQ(code("just text"), ErrorCode::kForeign);
  EXPECT_EQ(code("image: [a\nresolution: {"), ErrorCode::kDamaged);
  EXPECT_EQ(code(std::string(100'000, '[')), ErrorCode::kDamaged);
  EXPECT_EQ(code(std::string((1 << 20) + 1, '#')), ErrorCode::kLimit);
  EXPECT_EQ(testing::error_of([&] { open(map_server(), dir / "none.yaml"); }).code(), ErrorCode::kUnreadable);
}

TEST(MapServerBadInput, AMissingPictureNamesBothFiles) {
  const testing::TempDir dir;
  YamlText yaml;
  yaml.image = "gone.pgm";
  const auto path = testing::write_text(dir / "map.yaml", yaml.text());
  const Error error = testing::error_of([&] { open(map_server(), path); });
  EXPECT_EQ(error.code(), ErrorCode::kUnreadable);
  EXPECT_THAT(error.message(), HasSubstr("gone.pgm"));
  EXPECT_THAT(error.message(), HasSubstr("map.yaml"));
  EXPECT_THAT(error.hint(), HasSubstr("key 'image'"));
}

TEST(MapServerBadInput, DamagedPicturesAreRefused) {
  const std::pair<std::string, ErrorCode> cases[] = {
      {"", ErrorCode::kDamaged},
      {"P5", ErrorCode::kDamaged},
      {"P5 3 2 255\n12345", ErrorCode::kDamaged},
      {"P5 3 2 255\n1234567", ErrorCode::kDamaged},
      {"P5 3 2 0\n123456", ErrorCode::kDamaged},
      {"P5 3 2 65536\n123456", ErrorCode::kDamaged},
      {"P5 0 2 255\n", ErrorCode::kDamaged},
      {"P5 -3 2 255\n123456", ErrorCode::kDamaged},
      {"P5 99999999999999999999 2 255\n123456", ErrorCode::kDamaged},
      {"P5 2000000000 2000000000 255\n123456", ErrorCode::kLimit},
      {"P5 40000 40000 255\n123456", ErrorCode::kDamaged},
      {"P2 3 2 255 1 2 3 4 5", ErrorCode::kDamaged},
      {"P2 3 2 255 1 2 3 4 5 256", ErrorCode::kDamaged},
      {"P2 3 2 255 1 2 3 4 5 x", ErrorCode::kDamaged},
      {"P2 3 2 255 1 2 3 4 5 6 7", ErrorCode::kDamaged},
      {"P2 3 2 255 # no end", ErrorCode::kDamaged},
      {"P6 1 1 255 123", ErrorCode::kUnsupported},
      {"BM1234567", ErrorCode::kUnsupported},
      {"GIF89a", ErrorCode::kForeign},
      {"\x89PNG\r\n\x1a\n", ErrorCode::kDamaged}};
  for (const auto& [picture, code] : cases) {
    const Error error = open_bad({}, picture);
    EXPECT_EQ(error.code(), code) << picture;
    EXPECT_THAT(error.message(), HasSubstr("map.yaml"));
    EXPECT_THAT(error.path(), HasSubstr("a.pgm"));
  }
}

TEST(MapServerBadInput, EveryTruncationAndFlipOfAPngIsSafe) {
  const testing::TempDir dir;
  const auto map = open(map_server(), testing::save_map(dir, {}, p5({0, 205, 254, 0, 205, 254})));
  write(map_server(), *map, dir / "out.yaml", {{"image", "png"}});
  const std::string good = testing::read_text(dir / "out.png");
  YamlText yaml;
  yaml.image = "b.png";
  ::testing::internal::CaptureStderr();
  for (std::size_t n = 0; n < good.size(); ++n) {
    const Error error = open_bad(yaml, good.substr(0, n));
    EXPECT_TRUE(error.code() == ErrorCode::kDamaged || error.code() == ErrorCode::kForeign) << n;
  }
  for (std::size_t bit = 0; bit < good.size() * 8; bit += 3) {
    std::string bytes = good;
    bytes[bit / 8] = static_cast<char>(bytes[bit / 8] ^ (1 << (bit % 8)));
    const auto path = testing::save_map(dir, yaml, bytes);
    try {
      open(map_server(), path);
    } catch (const Error&) {
    }
  }
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

TEST(MapServerBadInput, HugePngsAreRefusedBeforeMemoryIsTaken) {
  const testing::TempDir dir;
  const auto map = open(map_server(), testing::save_map(dir, {}, p5({0, 205, 254, 0, 205, 254})));
  write(map_server(), *map, dir / "out.yaml", {{"image", "png"}});
  // The header with another size, and its checksum made right.
  std::string bytes = testing::read_text(dir / "out.png");
  bytes.replace(16, 8, std::string("\0\0\x9c\x40\0\0\x9c\x40", 8));
  std::uint32_t crc = 0xffffffffu;
  for (std::size_t i = 12; i < 29; ++i) {
    crc ^= static_cast<unsigned char>(bytes[i]);
    for (int k = 0; k < 8; ++k) crc = (crc & 1u) != 0 ? crc >> 1 ^ 0xedb88320u : crc >> 1;
  }
  crc ^= 0xffffffffu;
  for (int i = 0; i < 4; ++i)
    bytes[29 + static_cast<std::size_t>(i)] = static_cast<char>(crc >> (24 - 8 * i));
  YamlText yaml;
  yaml.image = "b.png";
  const Error error = open_bad(yaml, bytes);
  EXPECT_EQ(error.code(), ErrorCode::kDamaged);
  EXPECT_THAT(error.message(), HasSubstr("cut off"));
}

}  // namespace
}  // namespace apgm::converters
