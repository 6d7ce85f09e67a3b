#include "tools/common/picture.hpp"

#include <gd.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>

#include "apgm/core/error.hpp"
#include "apgm/core/map.hpp"
#include "temp_dir.hpp"

namespace apgm::tools {
namespace {

constexpr Colour kPaper{255, 255, 255};
constexpr Colour kInk{30, 30, 34};
constexpr Colour kMapBlue{1, 2, 250};

Raster plain(int width, int height, Colour colour = kMapBlue) {
  Raster raster{width, height, {}};
  for (int i = 0; i < width * height; ++i) {
    for (const int v : {int{colour.red}, int{colour.green}, int{colour.blue}, 255}) {
      raster.rgba.push_back(static_cast<std::uint8_t>(v));
    }
  }
  return raster;
}

Rendering plain_rendering(int width, int height, double pixel_m = 0.1) {
  Rendering r;
  r.raster = plain(width, height);
  r.area = {{-5, 2}, {-5 + width * pixel_m, 2 + height * pixel_m}};
  r.pixel_m = pixel_m;
  r.layers = 1;
  r.legend.entries = {{"occupied", {20, 20, 24}}, {"free", {250, 250, 246}}, {"unknown", {132, 148, 168}}};
  return r;
}

int count(const Raster& raster, Colour colour) {
  int n = 0;
  for (int row = 0; row < raster.height; ++row) {
    for (int column = 0; column < raster.width; ++column) n += raster.at(column, row) == colour ? 1 : 0;
  }
  return n;
}

// Longest horizontal run of ink.
int longest_run(const Raster& raster, Colour colour) {
  int longest = 0;
  for (int row = 0; row < raster.height; ++row) {
    int run = 0;
    for (int column = 0; column < raster.width; ++column) {
      run = raster.at(column, row) == colour ? run + 1 : 0;
      longest = std::max(longest, run);
    }
  }
  return longest;
}

// Text that runs off the picture would leave ink in its margins.
void expect_clean_margins(const Raster& picture) {
  for (int row = 0; row < picture.height; ++row) {
    for (const int column : {0, 5, picture.width - 6, picture.width - 1}) {
      ASSERT_EQ(picture.at(column, row), kPaper) << column << "," << row;
    }
  }
  for (int column = 0; column < picture.width; ++column) {
    for (const int row : {0, 5, picture.height - 5, picture.height - 1}) {
      ASSERT_EQ(picture.at(column, row), kPaper) << column << "," << row;
    }
  }
}

struct Corner {
  int column = -1, row = -1;
};
Corner map_corner(const Raster& picture) {
  for (int row = 0; row < picture.height; ++row) {
    for (int column = 0; column < picture.width; ++column) {
      if (picture.at(column, row) == kMapBlue) return {column, row};
    }
  }
  return {};
}

TEST(ScaleBarTest, IsARoundLengthInWholePixels) {
  const auto bar = [](double pixel_m, int most_px) { return scale_bar(pixel_m, most_px); };
  EXPECT_EQ(bar(0.1, 100).label, "10 m");
  EXPECT_EQ(bar(0.1, 100).length_px, 100);
  EXPECT_EQ(bar(0.1, 99).label, "5 m");
  EXPECT_EQ(bar(0.1, 99).length_px, 50);
  EXPECT_EQ(bar(0.2, 100).label, "20 m");
  EXPECT_EQ(bar(25.6, 60).label, "1 km");
  EXPECT_EQ(bar(25.6, 60).length_px, 39);
  EXPECT_EQ(bar(0.01, 60).label, "50 cm");
  EXPECT_EQ(bar(0.0001, 60).label, "5 mm");
  EXPECT_EQ(bar(1e-6, 60).label, "50 um");
}

TEST(ScaleBarTest, FitsAndIsTrueForAnyPixelSize) {
  const std::uint32_t seed = 3;
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  for (int i = 0; i < 2000; ++i) {
    const double pixel_m = std::pow(10.0, -7 + 14.0 * static_cast<double>(random()) / 4294967296.0);
    const int most_px = 60 + static_cast<int>(random() % 200u);
    const ScaleBar bar = scale_bar(pixel_m, most_px);
    ASSERT_LE(bar.length_px, most_px) << pixel_m;
    ASSERT_GE(bar.length_px, most_px * 2 / 5 - 1) << pixel_m;
    ASSERT_LE(std::abs(bar.length_px - bar.length_m / pixel_m), 0.5 + 1e-9) << pixel_m;
    const double digit = bar.length_m / std::pow(10.0, std::floor(std::log10(bar.length_m) + 1e-9));
    ASSERT_TRUE(std::abs(digit - 1) < 1e-9 || std::abs(digit - 2) < 1e-9 || std::abs(digit - 5) < 1e-9)
        << digit;
  }
}

TEST(ComposeTest, DrawsABarOfTheRightLength) {
  for (const double pixel_m : {0.1, 0.2, 0.05, 0.4, 25.6}) {
    const Raster picture = compose(plain_rendering(500, 40, pixel_m), {"t", {}});
    EXPECT_EQ(longest_run(picture, kInk), scale_bar(pixel_m, 500 / 3).length_px) << pixel_m;
  }
}

TEST(ComposeTest, KeepsThePixelsOfTheRaster) {
  Rendering r = plain_rendering(400, 50);
  std::mt19937 random(11);
  for (std::size_t i = 0; i < r.raster.rgba.size(); ++i) {
    if (i >= 8 && i % 4 != 3) r.raster.rgba[i] = static_cast<std::uint8_t>(random());
  }
  const Raster picture = compose(r, {"t", {"layer x"}});
  const Corner corner = map_corner(picture);
  ASSERT_GE(corner.column, 0);
  for (int row = 0; row < 50; ++row) {
    for (int column = 0; column < 400; ++column) {
      ASSERT_EQ(picture.at(corner.column + column, corner.row + row), r.raster.at(column, row));
    }
  }
}

TEST(ComposeTest, NoTextIsCutOrHidesTheMap) {
  const std::string word(64, 'W');
  for (const auto& [width, height] : std::vector<std::pair<int, int>>{{1, 1}, {3, 200}, {350, 2}, {900, 5}}) {
    Rendering r = plain_rendering(width, height);
    r.area = {{-999'999'999.99, -999'999'999.99}, {999'999'999.99, 999'999'999.99}};
    r.legend.entries = {{word, {9, 9, 9}}, {word, {8, 8, 8}}, {"short", {7, 7, 7}}};
    r.legend.scale = {{"-1.234e-38", {0, 0, 0}}, {"-1.234e-38", {0, 0, 99}}, {"-1.234e+38", {0, 99, 99}}};
    const Raster picture = compose(r, {word + word + " and words " + word, {word, word, "a, b", word}});
    expect_clean_margins(picture);
    EXPECT_EQ(count(picture, kMapBlue), width * height);
    EXPECT_EQ(count(picture, {9, 9, 9}), 12 * 12);
    EXPECT_EQ(count(picture, {7, 7, 7}), 12 * 12);
  }
}

TEST(ComposeTest, IsWideEnoughForSmallMaps) {
  const Raster picture = compose(plain_rendering(2, 2), {"t", {}});
  EXPECT_GE(picture.width, 360);
  expect_clean_margins(picture);
}

TEST(ComposeTest, TextThatIsNotAsciiDoesNoHarm) {
  const Raster latin =
      compose(plain_rendering(20, 20), {"caf\xC3\xA9 \xF0\x9F\x97\xBA \x01\x7F", {"\xFF\xFE"}});
  const Raster marks = compose(plain_rendering(20, 20), {"caf? ? ??", {"??"}});
  EXPECT_EQ(latin.rgba, marks.rgba);
}

TEST(ComposeTest, SquaresLieOnThePatchBorders) {
  Rendering r = plain_rendering(400, 64);
  r.patch_px = 32;
  r.patches = {{0, 32}, {32, 32}, {384, -16}};
  const Raster picture = compose(r, {"t", {}});
  Rendering plain_one = r;
  plain_one.patch_px = 0;
  const Corner corner = map_corner(compose(plain_one, {"t", {}}));
  const auto is_line = [&](int column, int row) {
    return picture.at(corner.column + column, corner.row + row) != kMapBlue;
  };
  for (int row = 0; row < 64; ++row) {
    for (int column = 0; column < 400; ++column) {
      const bool left_pair = row >= 32 && column <= 64 && (row == 32 || column % 32 == 0);
      const bool right_one = column >= 384 && ((row < 16 && column == 384) || (row == 16 && column > 384));
      ASSERT_EQ(is_line(column, row), left_pair || right_one) << column << "," << row;
    }
  }
}

TEST(ComposeTest, EmptyRasterSaysNoData) {
  const Raster picture = compose(Rendering{}, {"empty.apgm", {"layer occupancy"}});
  EXPECT_GE(picture.width, 360);
  EXPECT_GE(picture.height, 100);
  expect_clean_margins(picture);
  const Raster other = compose(Rendering{}, {"empty.apgm", {"layer occupancy"}, "N", "nothing at all"});
  EXPECT_NE(picture.rgba, other.rgba);
}

TEST(ComposeTest, ScaleOfColoursRunsFromFirstToLast) {
  Rendering r = plain_rendering(400, 10);
  r.legend.entries.clear();
  r.legend.scale = {{"0", {0, 100, 0}}, {"1", {200, 100, 0}}};
  const Raster picture = compose(r, {"t", {}});
  EXPECT_GT(count(picture, {0, 100, 0}), 0);
  EXPECT_GT(count(picture, {100, 100, 0}), 0);
  EXPECT_GT(count(picture, {200, 100, 0}), 0);
}

TEST(WritePngTest, ReadsBackAsTheSamePixels) {
  const test::TempDir dir;
  Raster raster = plain(37, 21);
  std::mt19937 random(5);
  for (std::size_t i = 0; i < raster.rgba.size(); ++i) {
    if (i % 4 != 3) raster.rgba[i] = static_cast<std::uint8_t>(random());
  }
  for (const char* name : {"a.png", "b.png"}) {
    OutputFile file(dir / name);
    write_png(raster, file);
    file.commit();
  }
  std::string bytes = test::read_file(dir / "a.png");
  EXPECT_EQ(bytes, test::read_file(dir / "b.png"));
  EXPECT_EQ(bytes.find("tIME"), std::string::npos);
  EXPECT_EQ(bytes.find("tEXt"), std::string::npos);
  const std::unique_ptr<gdImage, void (*)(gdImage*)> image(
      gdImageCreateFromPngPtr(static_cast<int>(bytes.size()), bytes.data()), gdImageDestroy);
  ASSERT_NE(image, nullptr);
  ASSERT_EQ(image->sx, 37);
  ASSERT_EQ(image->sy, 21);
  for (int y = 0; y < 21; ++y) {
    for (int x = 0; x < 37; ++x) {
      const int c = gdImageGetTrueColorPixel(image.get(), x, y);
      const Colour want = raster.at(x, y);
      ASSERT_EQ(c, gdTrueColor(want.red, want.green, want.blue)) << x << "," << y;
    }
  }
}

TEST(WritePngTest, RefusesAnEmptyRaster) {
  const test::TempDir dir;
  OutputFile file(dir / "a.png");
  EXPECT_THROW(write_png(Raster{}, file), Error);
}

TEST(ConflictPictureTest, ShowsConflictDarkWhereItIs) {
  ConflictPicture picture;
  std::vector<float> conflict(16, 0.0f);
  conflict[1] = 1.0f;   // cell (1, 0)
  conflict[15] = 0.5f;  // cell (3, 3)
  picture.put({0, 0}, 0, 2, conflict);
  picture.put({1, 1}, 0, 2, std::vector<float>(16, 0.0f));
  Frame frame;
  frame.datum_x_um = 100'000'000;
  const Rendering r = picture.rendering(frame);
  ASSERT_EQ(r.raster.width, 8);
  ASSERT_EQ(r.raster.height, 8);
  EXPECT_EQ(r.raster.at(1, 7), (Colour{0, 0, 0}));
  EXPECT_EQ(r.raster.at(0, 7), (Colour{255, 255, 255}));
  EXPECT_EQ(r.raster.at(3, 4), (Colour{127, 127, 127}));
  EXPECT_EQ(r.raster.at(0, 0), (Colour{132, 148, 168}));
  EXPECT_EQ(r.raster.at(7, 0), (Colour{255, 255, 255}));
  EXPECT_EQ(r.area, (Box{{100, 0}, {125.6, 25.6}}));
  EXPECT_DOUBLE_EQ(r.pixel_m, 3.2);
}

TEST(ConflictPictureTest, ShowsTheGreatestOfSeveralLayers) {
  ConflictPicture picture;
  picture.put({0, 0}, 0, 1, std::vector<float>{1.0f, 0.0f, 0.0f, 0.0f});
  std::vector<float> fine(16, 0.0f);
  fine[15] = 1.0f;
  picture.put({0, 0}, 1, 2, fine);
  const Rendering r = picture.rendering({});
  ASSERT_EQ(r.raster.width, 2);
  EXPECT_EQ(r.raster.at(0, 1), (Colour{0, 0, 0}));
  EXPECT_EQ(r.raster.at(1, 0), (Colour{0, 0, 0}));
  EXPECT_EQ(r.raster.at(0, 0), (Colour{255, 255, 255}));
}

TEST(ConflictPictureTest, NoConflictVanishesWhenSpaceRunsOut) {
  ConflictPicture picture({.most_cells = 100, .max_side = 8});
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 20; ++x) {
      std::vector<float> conflict(64, 0.0f);
      if (x == 13 && y == 2) conflict[37] = 1.0f;
      picture.put({x, y}, 0, 3, conflict);
    }
  }
  const Rendering r = picture.rendering({});
  EXPECT_LE(r.raster.width, 8);
  EXPECT_EQ(count(r.raster, {0, 0, 0}), 1);
  EXPECT_EQ(count(r.raster, {255, 255, 255}), r.raster.width * r.raster.height - 1);
}

TEST(ConflictPictureTest, NothingFusedGivesAnEmptyRaster) {
  const Rendering r = ConflictPicture().rendering({});
  EXPECT_TRUE(r.raster.empty());
  EXPECT_FALSE(r.legend.scale.empty());
}

TEST(ConflictPictureTest, PatchesAsFarApartAsIndicesGo) {
  ConflictPicture picture;
  const std::vector<float> full(4, 1.0f);
  picture.put({INT32_MIN, INT32_MIN}, 0, 1, full);
  picture.put({INT32_MAX, INT32_MAX}, 0, 1, full);
  const Rendering r = picture.rendering({});
  EXPECT_LE(r.raster.width, 2049);
  EXPECT_EQ(count(r.raster, {0, 0, 0}), 2);
}

}  // namespace
}  // namespace apgm::tools
