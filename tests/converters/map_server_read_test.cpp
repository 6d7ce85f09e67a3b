#include <png.h>

#include <cmath>

#include "tests/converters/map_server_support.hpp"

namespace apgm::converters {
namespace {

using testing::collect;
using testing::open;

using testing::beliefs;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::p5;
using testing::save_map;
using testing::YamlText;

constexpr double kOcc = 0.95, kFree = 0.05;  // BetP of masses of 0.9

std::vector<double> read(const YamlText& yaml, const std::string& picture, const Settings& settings = {}) {
  const testing::TempDir dir;
  return beliefs(collect(*open(map_server(), save_map(dir, yaml, picture), settings)));
}

/// A PNG written by libpng itself, 3 x 2.
std::string png(int colour_type, int depth, const std::vector<std::vector<png_byte>>& rows,
                bool interlaced = false, const std::vector<png_color>& palette = {}) {
  std::string bytes;
  png_structp p = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(p);
  png_set_write_fn(
      p, &bytes,
      [](png_structp s, png_bytep data, png_size_t n) {
        static_cast<std::string*>(png_get_io_ptr(s))->append(reinterpret_cast<char*>(data), n);
      },
      nullptr);
  png_set_IHDR(p, info, 3, 2, depth, colour_type, interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  if (!palette.empty()) png_set_PLTE(p, info, palette.data(), static_cast<int>(palette.size()));
  png_write_info(p, info);
  std::vector<png_bytep> pointers;
  for (const auto& row : rows) pointers.push_back(const_cast<png_bytep>(row.data()));
  png_write_image(p, pointers.data());
  png_write_end(p, info);
  png_destroy_write_struct(&p, &info);
  return bytes;
}

TEST(MapServerTrinary, ThresholdsClassify) {
  EXPECT_THAT(read({}, p5({0, 205, 254, 88, 90, 255})), ElementsAre(kOcc, -1, kFree, kOcc, -1, kFree));
}

TEST(MapServerTrinary, NegateTurnsShadesRound) {
  YamlText yaml;
  yaml.negate = "1";
  EXPECT_THAT(read(yaml, p5({0, 205, 254, 88, 90, 255})), ElementsAre(kFree, kOcc, kOcc, -1, -1, kOcc));
  yaml.negate = "true";
  EXPECT_EQ(read(yaml, p5({0, 0, 0, 0, 0, 255}))[5], kOcc);
}

TEST(MapServerTrinary, MassesCanBeSet) {
  const testing::TempDir dir;
  const auto path = save_map(dir, {}, p5({0, 205, 254, 0, 0, 0}));
  const Map map = collect(*open(map_server(), path, {{"occupied_mass", "0.7"}, {"free_mass", "0.4"}}));
  EXPECT_EQ(testing::masses_at(map, "occupancy", 0.05, 0.15, 7), std::pair(0.7f, 0.0f));
  EXPECT_EQ(testing::masses_at(map, "occupancy", 0.25, 0.15, 7), std::pair(0.0f, 0.4f));
}

TEST(MapServerTrinary, AlphaIsAveragedIn) {
  YamlText yaml;
  yaml.image = "a.png";
  // Opaque white; transparent white: (3 * 255 + 0) / 4 is a shade of 0.75; transparent black.
  EXPECT_THAT(
      read(yaml, png(PNG_COLOR_TYPE_GRAY_ALPHA, 8, {{255, 255, 255, 0, 0, 0}, {0, 255, 0, 0, 255, 255}})),
      ElementsAre(kFree, -1, kOcc, kOcc, kOcc, kFree));
}

TEST(MapServerScale, IsLinearBetweenTheThresholds) {
  YamlText yaml;
  yaml.mode = "scale";
  yaml.occupied_thresh = "0.8";
  yaml.free_thresh = "0.2";
  // occ = 1 - v / 255: 0.2 -> 0, 0.8 -> 100
  EXPECT_THAT(read(yaml, p5({0, 255, 204, 51, 153, 102})), ElementsAre(1, 0, 0, 1, 0.33, 0.67));
}

TEST(MapServerScale, WhatIsNotOpaqueIsUnknown) {
  YamlText yaml;
  yaml.mode = "scale";
  yaml.image = "a.png";
  EXPECT_THAT(read(yaml, png(PNG_COLOR_TYPE_RGB_ALPHA, 8,
                             {{0, 0, 0, 255, 0, 0, 0, 254, 255, 255, 255, 255},
                              {0, 0, 0, 0, 255, 255, 255, 0, 0, 0, 0, 255}})),
              ElementsAre(1, -1, 0, -1, -1, 1));
}

TEST(MapServerRaw, TakesValuesAsTheyAre) {
  YamlText yaml;
  yaml.mode = "raw";
  EXPECT_THAT(read(yaml, p5({0, 25, 100, 101, 255, 75})), ElementsAre(0, 0.25, 1, -1, -1, 0.75));
  EXPECT_THAT(read({}, p5({0, 25, 100, 101, 255, 75}), {{"mode", "raw"}}),
              ElementsAre(0, 0.25, 1, -1, -1, 0.75));
}

TEST(MapServerRaw, CountsEvenCellsAsLost) {
  const testing::TempDir dir;
  testing::Collected findings;
  open(map_server(), save_map(dir, {}, p5({0, 50, 50, 101, 255, 75})), {{"mode", "raw"}}, &findings);
  ASSERT_EQ(findings.losses().size(), 1u);
  EXPECT_THAT(findings.losses()[0], HasSubstr("2 cells of value 50"));
}

TEST(MapServerPictures, AllKindsOfPgmAgree) {
  const auto wanted = ElementsAre(kOcc, -1, kFree, kOcc, -1, kFree);
  EXPECT_THAT(read({}, "P2\n3 2 # size\n255\n0 205 254\n88 90 255\n"), wanted);
  EXPECT_THAT(read({}, "P2 3 2 15 0 12 15 5 6 15"), wanted);
  std::string wide = "P5 3 2 65535\n";
  for (const int v : {0, 205, 254, 88, 90, 255}) wide += std::string(2, static_cast<char>(v));
  EXPECT_THAT(read({}, wide), wanted);
}

TEST(MapServerPictures, AllKindsOfPngAgree) {
  YamlText yaml;
  yaml.image = "a.png";
  const auto wanted = ElementsAre(kOcc, -1, kFree, kFree, kOcc, -1);
  const png_byte U = 205;
  for (const bool interlaced : {false, true}) {
    EXPECT_THAT(read(yaml, png(PNG_COLOR_TYPE_GRAY, 8, {{0, U, 255}, {255, 0, U}}, interlaced)), wanted);
    EXPECT_THAT(read(yaml, png(PNG_COLOR_TYPE_RGB, 8,
                               {{0, 0, 0, U, U, U, 255, 255, 255}, {255, 255, 255, 0, 0, 0, 255, 105, 255}},
                               interlaced)),
                wanted);
    EXPECT_THAT(read(yaml, png(PNG_COLOR_TYPE_GRAY, 16, {{0, 0, U, U, 255, 255}, {255, 255, 0, 0, U, U}},
                               interlaced)),
                wanted);
    EXPECT_THAT(read(yaml, png(PNG_COLOR_TYPE_PALETTE, 2, {{0b00011000}, {0b10000100}}, interlaced,
                               {{0, 0, 0}, {U, U, U}, {255, 255, 255}})),
                wanted);
  }
  EXPECT_THAT(read(yaml, png(PNG_COLOR_TYPE_GRAY, 1, {{0b01000000}, {0b10100000}})),
              ElementsAre(kOcc, kFree, kOcc, kFree, kOcc, kFree));
}

TEST(MapServerFrame, DatumIsTheOrigin) {
  const testing::TempDir dir;
  YamlText yaml;
  yaml.origin = "[-11.606540, 26.520793, 0.000000]";
  const Map map = collect(*open(map_server(), save_map(dir, yaml, p5({0, 205, 254, 0, 0, 254}))));
  EXPECT_EQ(map.header().frame.datum_x_um, -11'606'540);
  EXPECT_EQ(map.header().frame.datum_y_um, 26'520'793);
  EXPECT_THAT(beliefs(map), ElementsAre(kOcc, -1, kFree, kOcc, kOcc, kFree));
  EXPECT_EQ(map.header().metadata.at("map_server.width"), "3");
}

TEST(MapServerFrame, YawTurnsAboutTheOrigin) {
  const testing::TempDir dir;
  YamlText yaml;
  yaml.origin = "[10.0, 20.0, 1.5707963267948966]";
  const auto source = open(map_server(), save_map(dir, yaml, p5({205, 205, 205, 205, 205, 0})));
  const Map map = collect(*source, false);
  // The pixel at x = 0.2..0.3, y = 0..0.1 comes to x = -0.1..0, y = 0.2..0.3.
  EXPECT_NEAR(testing::masses_at(map, "occupancy", 9.95, 20.25, 7).first, 0.9, 1e-5);
  EXPECT_EQ(source->header().metadata.count("map_server.width"), 0u);
}

TEST(MapServerFrame, ADatumOffTheCellsIsRegridded) {
  const testing::TempDir dir;
  const auto path = save_map(dir, {}, p5({205, 205, 205, 205, 205, 0}));
  const Map map = collect(*open(map_server(), path, {{"datum", "0.05,0"}}), false);
  const float half = 1 - std::sqrt(0.1f);
  EXPECT_NEAR(testing::masses_at(map, "occupancy", 0.2, 0.05, 7).first, half, 1e-5);
  EXPECT_NEAR(testing::masses_at(map, "occupancy", 0.3, 0.05, 7).first, half, 1e-5);
  const Map exact = collect(*open(map_server(), path, {{"datum", "-0.7,100"}}));
  EXPECT_EQ(testing::masses_at(exact, "occupancy", 0.25, 0.05, 7).first, 0.9f);
}

TEST(MapServerReader, RegriddingIsALoss) {
  const testing::TempDir dir;
  const std::pair<Settings, const char*> cases[] = {
      {{{"edge_m", "10"}}, "[0, 0, 0]"}, {{{"datum", "0.01,0"}}, "[0, 0, 0]"}, {{}, "[0, 0, 0.5]"}};
  for (const auto& [settings, origin] : cases) {
    testing::YamlText yaml;
    yaml.origin = origin;
    testing::Collected known, unknown;
    open(map_server(), testing::save_map(dir, yaml, testing::p5({0, 0, 0, 0, 0, 0})), settings, &known);
    EXPECT_EQ(known.losses().size(), 1u) << origin;
    open(map_server(), testing::save_map(dir, yaml, testing::p5({205, 205, 205, 205, 205, 205})), settings,
         &unknown);
    EXPECT_TRUE(unknown.losses().empty()) << origin;
  }
  testing::Collected whole;
  open(map_server(), testing::save_map(dir, {}, testing::p5({0, 0, 0, 0, 0, 0})),
       {{"edge_m", "6.4"}, {"datum", "0.3,0"}}, &whole);
  EXPECT_TRUE(whole.losses().empty());
}

}  // namespace
}  // namespace apgm::converters
