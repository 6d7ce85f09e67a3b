#include "apgm/observe/profile.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "apgm/core/error.hpp"

namespace apgm {
namespace {

using ::testing::HasSubstr;
using Random = std::mt19937_64;

double uniform(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

Profile profile_of(std::vector<Requirement> requirements) { return {"test", std::move(requirements)}; }

std::vector<PatchIndex> wanted(const Profile& profile, const Frame& frame, Point vehicle) {
  std::vector<PatchIndex> patches;
  const ProfileInFrame in_frame(profile, frame);
  const PatchRange reach = in_frame.reach(vehicle);
  for (std::int32_t y = reach.min.y; y <= reach.max.y; ++y) {
    for (std::int32_t x = reach.min.x; x <= reach.max.x; ++x) {
      if (in_frame.required_step({x, y}, "occupancy", vehicle)) patches.push_back({x, y});
    }
  }
  return patches;
}

const Profile& parking() {
  static const Profile profile = profile_of({{"occupancy", 0.1, Ring{0, 20}}});
  return profile;
}

TEST(ProfileTest, ExpectedPatchesOfADiscAre14_92) {
  // Expectation over positions: (pi R^2 + 4 e R + e^2) / e^2. A square horizon would give (2 R / e + 1)^2
  // = 17.0.
  const Frame frame;
  const double e = frame.edge_m(), r = 20;
  const double expected = (std::numbers::pi * r * r + 4 * e * r + e * e) / (e * e);
  Random random(1);
  double patches = 0, cells = 0;
  constexpr int kPositions = 20'000;
  for (int i = 0; i < kPositions; ++i) {
    const Point vehicle{uniform(random, -500, 500), uniform(random, -500, 500)};
    for (const PatchIndex p : wanted(parking(), frame, vehicle)) {
      const int step = ProfileInFrame(parking(), frame).required_step(p, "occupancy", vehicle).value();
      ++patches;
      cells += std::pow(4, step);
    }
  }
  EXPECT_NEAR(expected, 14.92, 0.005);
  EXPECT_NEAR(patches / kPositions, expected, 0.01 * expected);
  EXPECT_NEAR(cells / kPositions, 244.4e3, 0.01 * 244.4e3);
}

TEST(ProfileTest, ReachHoldsEveryWantedPatchAndIsTightForDiscs) {
  Random random(2);
  for (int i = 0; i < 300; ++i) {
    Frame frame;
    frame.datum_x_um = -123'456'789;
    const Point vehicle{uniform(random, -300, 300), uniform(random, -300, 300)};
    const PatchRange reach = ProfileInFrame(parking(), frame).reach(vehicle);
    PatchRange met;
    for (std::int32_t y = reach.min.y - 2; y <= reach.max.y + 2; ++y) {
      for (std::int32_t x = reach.min.x - 2; x <= reach.max.x + 2; ++x) {
        if (ProfileInFrame(parking(), frame).required_step({x, y}, "occupancy", vehicle))
          met.add(PatchIndex{x, y});
      }
    }
    ASSERT_EQ(met, reach) << vehicle.x_m << " " << vehicle.y_m;
  }
}

TEST(ProfileTest, ARingMeetsClosedSquares) {
  Frame frame;
  frame.edge_um = 10'000'000;
  const Profile disc = profile_of({{"occupancy", 10, Ring{0, 5}}});
  const auto step = [&](const Profile& p, PatchIndex patch, Point vehicle) {
    return ProfileInFrame(p, frame).required_step(patch, "occupancy", vehicle).has_value();
  };
  EXPECT_TRUE(step(disc, {1, 0}, {5, 5}));  // touches in a point
  EXPECT_TRUE(step(disc, {-1, 0}, {5, 5}));
  EXPECT_FALSE(step(disc, {1, 0}, {4.999999999, 5}));
  EXPECT_FALSE(step(disc, {1, 1}, {5, 5}));
  EXPECT_TRUE(step(disc, {1, 1}, {7, 6}));  // the corner is 3-4-5 away
  const Profile ring = profile_of({{"occupancy", 10, Ring{5, 100}}});
  EXPECT_TRUE(step(ring, {0, 0}, {5, 5}));
  const Profile outer = profile_of({{"occupancy", 10, Ring{7.08, 100}}});
  EXPECT_FALSE(step(outer, {0, 0}, {5, 5}));  // corners are 7.071 away
  EXPECT_TRUE(step(outer, {0, 0}, {4.9, 5}));
  EXPECT_EQ(ProfileInFrame(disc, frame).reach({5, 5}), (PatchRange{{-1, -1}, {1, 1}}));
}

TEST(ProfileTest, TheFinestRequirementWins) {
  const Frame frame;
  const Profile profile = profile_of({{"occupancy", 0.4, Ring{20, 100}},
                                      {"occupancy", 0.1, Ring{0, 20}},
                                      {"semantics", 0.2, Ring{0, 40}},
                                      {"occupancy", 0.2, Polygon{{{{60, 60}, {64, 60}, {64, 64}}}}}});
  const auto step = [&](PatchIndex p, const char* layer) {
    return ProfileInFrame(profile, frame).required_step(p, layer, {5, 5});
  };
  EXPECT_EQ(step({0, 0}, "occupancy"), 7);
  EXPECT_EQ(step({1, 1}, "occupancy"), 7);
  EXPECT_EQ(step({3, 0}, "occupancy"), 5);
  EXPECT_EQ(step({4, 4}, "occupancy"), 6);
  EXPECT_EQ(step({9, 0}, "occupancy"), std::nullopt);
  EXPECT_EQ(step({0, 0}, "semantics"), 6);
  EXPECT_EQ(step({4, 4}, "semantics"), std::nullopt);
  EXPECT_EQ(step({0, 0}, "velocity"), std::nullopt);
}

TEST(ProfileTest, APolygonWantsThePatchesItSharesAreaWith) {
  const Frame frame;
  const double e = frame.edge_m();
  const Profile profile = profile_of({{"occupancy", 0.2, Polygon{{{{0, 0}, {e, 0}, {e, e}, {0, e}}}}}});
  EXPECT_EQ(ProfileInFrame(profile, frame).required_step({0, 0}, "occupancy", {1e6, 1e6}), 6);
  for (const PatchIndex p : {PatchIndex{1, 0}, PatchIndex{-1, 0}, PatchIndex{0, 1}, PatchIndex{-1, -1}}) {
    EXPECT_EQ(ProfileInFrame(profile, frame).required_step(p, "occupancy", {0, 0}), std::nullopt);
  }
  EXPECT_TRUE(ProfileInFrame(profile, frame).reach({1e6, 1e6}).contains({0, 0}));
}

TEST(ProfileTest, RefusesAVehicleNowhere) {
  EXPECT_THROW(ProfileInFrame(parking(), Frame{}).reach({std::nan(""), 0}), Error);
  EXPECT_THROW(ProfileInFrame(parking(), Frame{}).required_step({0, 0}, "occupancy", {0, 1e300}), Error);
}

TEST(ProfileTest, RefusesRingsOutOfRangeUnchecked) {
  const Profile profile = profile_of({{"occupancy", 0.1, Ring{0, 1e300}}});
  EXPECT_THROW(ProfileInFrame(profile, Frame{}).reach({0, 0}), Error);
}

TEST(ProfileTest, NothingIsWantedWithoutRequirements) {
  EXPECT_TRUE(ProfileInFrame(Profile{}, Frame{}).reach({0, 0}).empty());
  EXPECT_EQ(ProfileInFrame(Profile{}, Frame{}).required_step({0, 0}, "occupancy", {0, 0}), std::nullopt);
}

std::string check(std::vector<Requirement> requirements) {
  const TypeTable types({LayerType::occupancy(), LayerType::semantic("semantics", {"a", "b"})});
  try {
    profile_of(std::move(requirements)).check({}, types);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    return error.message() + " | " + error.hint();
  }
  return "fine";
}

TEST(ProfileTest, ChecksLayersAndCellSizes) {
  EXPECT_EQ(check({{"occupancy", 0.1, Ring{0, 20}}, {"semantics", 12.8, Ring{0, 20}}}), "fine");
  EXPECT_EQ(check({{"occupancy", 12.8 / 2048, Ring{0, 20}}}), "fine");
  EXPECT_THAT(
      check({{"velocity", 0.1, Ring{0, 20}}}),
      HasSubstr(
          "profile 'test': layer 'velocity' is not one of the map | its layers are occupancy, semantics"));
  EXPECT_THAT(check({{"occupancy", 0.15, Ring{0, 20}}}), HasSubstr("wants cells of 0.15 m"));
  EXPECT_THAT(check({{"occupancy", 0.15, Ring{0, 20}}}), HasSubstr("the nearest below is 0.1"));
  EXPECT_THAT(check({{"occupancy", 25.6, Ring{0, 20}}}), HasSubstr("power-of-two part"));
  EXPECT_THAT(check({{"occupancy", 0.003125, Ring{0, 20}}}), HasSubstr("power-of-two part"));
  for (const double bad : {0.0, -1.0, std::nan(""), HUGE_VAL}) {
    EXPECT_THAT(check({{"occupancy", bad, Ring{0, 20}}}), HasSubstr("no cell size above 0"));
  }
}

TEST(ProfileTest, ChecksAreas) {
  EXPECT_EQ(check({{"occupancy", 0.1, Ring{0, 20}},
                   {"occupancy", 0.2, Ring{20, 40}},
                   {"semantics", 0.2, Ring{0, 40}}}),
            "fine");
  EXPECT_THAT(check({{"occupancy", 0.1, Ring{0, 20}}, {"occupancy", 0.2, Ring{19, 40}}}),
              HasSubstr("overlapping bands: 0..20 m and 19..40 m"));
  EXPECT_THAT(check({{"occupancy", 0.2, Ring{0, 40}}, {"occupancy", 0.1, Ring{0, 20}}}),
              HasSubstr("overlapping bands"));
  for (const Ring bad :
       {Ring{5, 5}, Ring{-1, 5}, Ring{0, std::nan("")}, Ring{std::nan(""), 5}, Ring{0, 1.1e6}}) {
    EXPECT_THAT(check({{"occupancy", 0.1, bad}}), HasSubstr("has a ring from"));
  }
  EXPECT_EQ(check({{"occupancy", 0.1, Ring{0, 20}}, {"occupancy", 0.1, Polygon{{{{0, 0}, {1, 0}, {1, 1}}}}}}),
            "fine");
  EXPECT_THAT(check({{"occupancy", 0.1, Polygon{{{{0, 0}, {1, 0}}}}}}), HasSubstr("fewer than 3 corners"));
  EXPECT_THAT(check({{"occupancy", 0.1, Polygon{{{{0, 0}, {1, 0}, {2, 0}}}}}}), HasSubstr("without area"));
  EXPECT_THAT(check({{"occupancy", 0.1, Polygon{}}}), HasSubstr("without area"));
  EXPECT_THAT(check({{"occupancy", 0.1, Polygon{{{{0, 0}, {1, std::nan("")}, {2, 0}}}}}}),
              HasSubstr("not a finite"));
}

TEST(ProfileTest, RefusesCellsAtWhichALayerIsTooLarge) {
  const TypeTable types({LayerType::semantic("five", {"a", "b", "c", "d", "e"}),
                         LayerType::semantic("three", {"a", "b", "c"})});
  const auto cells_of = [](const char* layer, double cell_m) {
    return profile_of({{layer, cell_m, Ring{0, 20}}});
  };
  EXPECT_NO_THROW(cells_of("three", 12.8 / 2048).check({}, types));  // 64 MiB
  EXPECT_NO_THROW(cells_of("five", 12.8 / 1024).check({}, types));
  try {
    cells_of("five", 12.8 / 2048).check({}, types);  // 96 MiB
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    EXPECT_THAT(error.what(), HasSubstr("layer 'five' wants cells of 0.00625 m"));
    EXPECT_THAT(error.hint(), HasSubstr("0.0125 m"));
  }
}

TEST(ProfileTest, OnlyRingsOnALineHaveNoArea) {
  const auto polygon = [](std::vector<std::vector<Point>> rings) {
    return check({{"occupancy", 0.1, Polygon{std::move(rings)}}});
  };
  EXPECT_EQ(polygon({{{0, 0}, {2, 2}, {2, 0}, {0, 2}}}), "fine") << "a bow tie has area, even-odd";
  EXPECT_EQ(polygon({{{0, 0}, {1e9, 0}, {1e9, 1e9}, {0, 1e-6}}}), "fine");
  for (const double scale : {0.1, 1.0, 1e8}) {
    const Point a{0, 0}, b{scale, 2 * scale}, c{3 * scale, 6 * scale};
    EXPECT_THAT(polygon({{a, b, c}}), HasSubstr("without area")) << scale;
    EXPECT_THAT(polygon({{a, a, c, b}}), HasSubstr("without area")) << scale;
    EXPECT_THAT(polygon({{a, b, {0, scale}}, {a, b, c}}), HasSubstr("without area")) << scale;
    EXPECT_EQ(polygon({{a, b, {0, scale}}}), "fine") << scale;
  }
  EXPECT_THAT(polygon({{{3, 3}, {3, 3}, {3, 3}}}), HasSubstr("without area"));
}

TEST(ScheduleTest, RefusesToBeEmpty) { EXPECT_THROW(Schedule{}.at(0), Error); }

}  // namespace
}  // namespace apgm
