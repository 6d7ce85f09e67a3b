#include "apgm/observe/measurement.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "apgm/core/error.hpp"

namespace apgm {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

void expect_near(Point p, double x_m, double y_m) {
  EXPECT_NEAR(p.x_m, x_m, 1e-12);
  EXPECT_NEAR(p.y_m, y_m, 1e-12);
}

LaserScan laser_of(std::vector<float> ranges_m) {
  LaserScan scan;
  scan.angle_step_rad = kPi / 2;
  scan.max_range_m = 50;
  scan.ranges_m = std::move(ranges_m);
  return scan;
}

TEST(PoseTest, PlanarTurnsFromXTowardsY) {
  const auto p = Pose::planar(10, 20, kPi / 2).apply({1, 2, 3});
  EXPECT_NEAR(p[0], 8, 1e-12);
  EXPECT_NEAR(p[1], 21, 1e-12);
  EXPECT_EQ(p[2], 3);
}

TEST(PoseTest, QuaternionAndAngleAgree) {
  for (const double yaw : {0.0, 0.3, -2.0, 3.1}) {
    const Pose a = Pose::planar(1, 2, yaw);
    const Pose b = Pose::from_quaternion({1, 2, 0}, std::cos(yaw / 2), 0, 0, std::sin(yaw / 2));
    for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(a.rotation[i], b.rotation[i], 1e-12);
  }
}

TEST(PoseTest, QuaternionIsNormalised) {
  EXPECT_NO_THROW(Pose::from_quaternion({}, 1.0005, 0, 0, 0));
  EXPECT_EQ(Pose::from_quaternion({}, 1.0005, 0, 0, 0), Pose{});
  EXPECT_THROW(Pose::from_quaternion({}, 1.01, 0, 0, 0), Error);
  EXPECT_THROW(Pose::from_quaternion({}, 0, 0, 0, 0), Error);
  EXPECT_THROW(Pose::from_quaternion({}, std::nan(""), 0, 0, 1), Error);
}

TEST(PoseTest, ChecksRefuseWhatIsNoRotation) {
  EXPECT_NO_THROW(Pose{}.check());
  Pose mirrored;
  mirrored.rotation[8] = -1;
  EXPECT_THROW(mirrored.check(), Error);
  Pose scaled;
  scaled.rotation[0] = 1.01;
  EXPECT_THROW(scaled.check(), Error);
  EXPECT_THROW(Pose::planar(0, 0, std::nan("")).check(), Error);
  EXPECT_THROW(Pose::planar(0, std::nan(""), 0).check(), Error);
  EXPECT_THROW(to_range_scan(
                   [] {
                     LaserScan scan = laser_of({1});
                     scan.pose.translation_m[0] = HUGE_VAL;
                     return scan;
                   }(),
                   {}, *std::make_unique<Skipped>()),
               Error);
}

TEST(LaserScanTest, BeamsFollowAnglesAndPose) {
  LaserScan scan = laser_of({1, 2, 3});
  scan.pose = Pose::planar(100, 200, kPi / 2);
  scan.stamp_ns = 7;
  Skipped skipped;
  const RangeScan out = to_range_scan(scan, {}, skipped);
  EXPECT_EQ(out.stamp_ns, 7);
  EXPECT_EQ(out.source, "laser");
  EXPECT_EQ(out.origin, (Point{100, 200}));
  ASSERT_EQ(out.beams.size(), 3u);
  expect_near(out.beams[0].to, 100, 201);
  expect_near(out.beams[1].to, 98, 200);
  expect_near(out.beams[2].to, 100, 197);
  for (const auto& beam : out.beams) {
    EXPECT_TRUE(beam.hit);
    EXPECT_EQ(beam.from, out.origin);
  }
  EXPECT_EQ(skipped.total(), 0u);
}

TEST(LaserScanTest, CountsWhatItDoesNotUse) {
  Skipped skipped;
  const LaserScan scan = laser_of({kNan, kInf, -kInf, 0, 0.05f, -1, 50, 49.9f, 51, 0.1f});
  const RangeScan out = to_range_scan(scan, {.min_range_m = 0.0999}, skipped);
  EXPECT_EQ(out.beams.size(), 2u);
  EXPECT_EQ(skipped.not_a_number, 1u);
  EXPECT_EQ(skipped.too_near, 4u);
  EXPECT_EQ(skipped.no_return, 3u);
  EXPECT_EQ(skipped.total(), 8u);
  EXPECT_TRUE(to_range_scan(laser_of({0}), {.min_range_m = 0}, skipped).beams.empty());
  to_range_scan(scan, {.max_range_m = 10}, skipped);
  EXPECT_EQ(skipped.no_return, 7u);  // the lesser maximum counts
}

TEST(LaserScanTest, BeamsWithoutReturnClearAsFarAsSaid) {
  Skipped skipped;
  const RangeScan out = to_range_scan(laser_of({kInf, 60, 5}), {.no_return_clears_m = 8}, skipped);
  ASSERT_EQ(out.beams.size(), 3u);
  expect_near(out.beams[0].to, 8, 0);
  expect_near(out.beams[1].to, 0, 8);
  EXPECT_FALSE(out.beams[0].hit);
  EXPECT_TRUE(out.beams[2].hit);
  EXPECT_EQ(skipped.no_return, 2u);
  const RangeScan nearer =
      to_range_scan(laser_of({kInf}), {.max_range_m = 3, .no_return_clears_m = 8}, skipped);
  expect_near(nearer.beams.at(0).to, 3, 0);
}

TEST(LaserScanTest, RefusesAnglesThatAreNoNumbers) {
  LaserScan scan = laser_of({1});
  scan.angle_min_rad = std::nan("");
  Skipped skipped;
  EXPECT_THROW(to_range_scan(scan, {}, skipped), Error);
}

RangeScan scan_of(std::vector<float> xyz_m, double sensor_z_m, const RangeLimits& limits, Skipped& skipped) {
  PointCloud cloud;
  cloud.pose.translation_m = {0, 0, sensor_z_m};
  cloud.xyz_m = std::move(xyz_m);
  return to_range_scan(cloud, limits, skipped);
}

constexpr RangeLimits kSlab{.min_range_m = 0.5, .max_range_m = 50, .z_min_m = 0.25, .z_max_m = 2};

TEST(PointCloudTest, ReturnsWithinTheHeightsAreHits) {
  Skipped skipped;
  const RangeScan out = scan_of({3, 4, 0, 10, 0, 0.5f}, 1, kSlab, skipped);
  ASSERT_EQ(out.beams.size(), 2u);
  EXPECT_EQ(out.beams[0], (RangeScan::Beam{{0, 0}, {3, 4}, true}));
  EXPECT_TRUE(out.beams[1].hit);
}

TEST(PointCloudTest, GroundReturnsClearDownToTheLowerHeight) {
  Skipped skipped;
  // From 1 m high to the ground 8 m ahead: at 6 m the beam is 0.25 m high.
  const RangeScan out = scan_of({8, 0, -1}, 1, kSlab, skipped);
  ASSERT_EQ(out.beams.size(), 1u);
  EXPECT_FALSE(out.beams[0].hit);
  EXPECT_EQ(out.beams[0].from, (Point{0, 0}));
  expect_near(out.beams[0].to, 6, 0);
}

TEST(PointCloudTest, BeamsFromAboveEnterAtTheUpperHeight) {
  Skipped skipped;
  // From 4 m down to 1 m over 6 m: at 2 m after 4 m.
  const RangeScan out = scan_of({6, 0, -3}, 4, kSlab, skipped);
  ASSERT_EQ(out.beams.size(), 1u);
  expect_near(out.beams[0].from, 4, 0);
  EXPECT_EQ(out.beams[0].to, (Point{6, 0}));
  EXPECT_TRUE(out.beams[0].hit);
}

TEST(PointCloudTest, HeightsAreHalfOpen) {
  Skipped skipped;
  const RangeScan out = scan_of({5, 0, 1, 5, 1, -0.75f}, 1, kSlab, skipped);
  ASSERT_EQ(out.beams.size(), 2u);
  EXPECT_FALSE(out.beams[0].hit);  // z = 2
  EXPECT_TRUE(out.beams[1].hit);   // z = 0.25
}

TEST(PointCloudTest, CountsWhatItDoesNotUse) {
  Skipped skipped;
  const RangeScan out = scan_of({kNan, 0, 0, kInf, 0, 0, 0.1f, 0, 0, 60, 0, 0, 3e38f, 3e38f, 3e38f, 5, 0, 3},
                                2.5, kSlab, skipped);
  EXPECT_TRUE(out.beams.empty());
  EXPECT_EQ(skipped.not_a_number, 2u);
  EXPECT_EQ(skipped.too_near, 1u);
  EXPECT_EQ(skipped.no_return, 2u);
  EXPECT_EQ(skipped.outside, 1u);  // runs above the heights all the way
}

TEST(PointCloudTest, PointsBeyondTheMaximumClearAlongTheirDirection) {
  Skipped skipped;
  RangeLimits limits = kSlab;
  limits.no_return_clears_m = 10;
  const RangeScan out = scan_of({36, 48, 0}, 1, limits, skipped);
  ASSERT_EQ(out.beams.size(), 1u);
  expect_near(out.beams[0].to, 6, 8);
  EXPECT_FALSE(out.beams[0].hit);
}

TEST(PointCloudTest, RefusesHalfAPoint) {
  Skipped skipped;
  EXPECT_THROW(scan_of({1, 2}, 1, kSlab, skipped), Error);
}

}  // namespace
}  // namespace apgm
