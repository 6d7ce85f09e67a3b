#include "apgm/observe/mapper.hpp"

#include <array>
#include <cmath>
#include <functional>

#include <gmock/gmock.h>

#include "apgm/core/error.hpp"
#include "apgm/fuse/framework.hpp"
#include "drives.hpp"

namespace apgm {
namespace {

using test::coarse_options;
using test::difference;
using test::kSecond;
using test::Random;

/// A fan of beams from (0.05, 0.05) to a wall at x = 5.05.
RangeScan wall_scan(std::int64_t stamp_ns) {
  RangeScan scan;
  scan.stamp_ns = stamp_ns;
  scan.origin = {0.05, 0.05};
  for (int i = -100; i <= 100; ++i) scan.beams.push_back({scan.origin, {5.05, 0.05 + 0.02 * i}, true});
  return scan;
}

struct Cell {
  float occupied, free;
};
Cell cell_at(const Map& map, Point p) {
  const Frame& frame = map.header().frame;
  const TypeId type = *map.header().types.find("occupancy");
  const Layer* layer = map.find(frame.patch_at(p), type);
  if (layer == nullptr) return {0, 0};
  const CellIndex c = frame.cell_at(p, layer->step()).cell;
  return {layer->at(0, c), layer->at(1, c)};
}

ErrorCode code_of(const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& e) {
    return e.code();
  }
  ADD_FAILURE() << "nothing was thrown";
  return ErrorCode::kCancelled;
}

/// One occupancy patch at (0, 0), all cells with these masses.
Map even_map(float occupied, float free, int step = 2) {
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  Map map(header);
  Layer& layer = map.layer({0, 0}, 0, step);
  std::ranges::fill(layer.plane(0), occupied);
  std::ranges::fill(layer.plane(1), free);
  return map;
}

TEST(MapperTest, AStillVehicleBeforeAWallConverges) {
  Mapper mapper(Frame{}, Models{});
  MapperReport report;
  for (int i = 0; i < 60; ++i) report = mapper.add(wall_scan(i * kSecond / 10));
  for (const double y : {-1.0, 0.05, 1.5}) {
    const Cell wall = cell_at(mapper.map(), {5.05, y});
    EXPECT_GT(wall.occupied, 0.97f);
    EXPECT_LE(wall.occupied + wall.free, 0.98f + 2e-6f);
    const Cell front = cell_at(mapper.map(), {2.55, y / 2});
    EXPECT_GT(front.free, 0.97f);
    EXPECT_LT(front.occupied, 0.01f);
    const Cell behind = cell_at(mapper.map(), {5.55, y});
    EXPECT_EQ(behind.occupied, 0.0f);
    EXPECT_EQ(behind.free, 0.0f);
  }
  EXPECT_EQ(report.total_conflicts, 0u);
  EXPECT_EQ(mapper.map().header().types[*mapper.map().header().types.find("occupancy")].policy,
            Policy::kConditional);
}

TEST(MapperTest, AMapThatWasSureChangesItsMind) {
  Mapper mapper(Frame{}, Models{});
  for (int i = 0; i < 200; ++i) mapper.add(wall_scan(i));
  RangeScan through = wall_scan(200);
  for (auto& beam : through.beams) beam.to.x_m = 9.05;
  int scans = 0;
  while (cell_at(mapper.map(), {5.05, 0.05}).free < 0.9f && scans < 100) {
    mapper.add(through);
    ++scans;
  }
  EXPECT_LT(scans, 30);
}

TEST(MapperTest, TwoLidarsAndACameraShareOneMap) {
  Models models;
  models.limits.z_min_m = 0.3;
  models.limits.z_max_m = 2.0;
  Mapper mapper(Frame{}, models);
  Skipped skipped;
  LaserScan laser;
  laser.angle_min_rad = -1.5;
  laser.angle_step_rad = 0.005;
  laser.max_range_m = 30;
  laser.pose = Pose::planar(0, 0, 0);
  laser.pose.translation_m[2] = 1.0;
  laser.ranges_m.assign(600, 8.0f);
  PointCloud cloud;
  cloud.pose = Pose::planar(0, 0.5, 3.14159);
  cloud.pose.translation_m[2] = 1.0;
  for (int i = -300; i <= 300; ++i) {
    cloud.xyz_m.insert(cloud.xyz_m.end(), {6.0f, 0.02f * static_cast<float>(i), 0.0f});
  }
  LabelledGround image;
  for (int i = 0; i < 500; ++i) image.pixels.push_back({{5 + 0.01 * i, 1}, 1});
  for (int k = 0; k < 5; ++k) {
    mapper.add(to_range_scan(laser, models.limits, skipped));
    mapper.add(to_range_scan(cloud, models.limits, skipped));
    mapper.add(image);
  }
  const Map& map = mapper.map();
  EXPECT_GT(cell_at(map, {8.0, 0.0}).occupied, 0.9f);
  EXPECT_GT(cell_at(map, {-6.0, 0.5}).occupied, 0.9f);
  EXPECT_GT(cell_at(map, {4.0, 0.0}).free, 0.7f);
  EXPECT_GT(cell_at(map, {-3.0, 0.5}).free, 0.7f);
  const TypeId semantics = *map.header().types.find("semantics");
  const Layer* layer = map.find({0, 0}, semantics);
  ASSERT_NE(layer, nullptr);
  const CellIndex c = map.header().frame.cell_at({7, 1}, layer->step()).cell;
  EXPECT_GT(layer->at(1, c), 0.8f);
  EXPECT_NEAR(layer->at(0, c) + layer->at(1, c) + layer->at(2, c) + layer->at(3, c), 1, 1e-6);
  EXPECT_GE(layer->at(3, c), 0.02f - 1e-6f);
}

/// Scans of a vehicle that drives 4 m along the wall.
Map map_of(int first, int last, const MapperOptions& options) {
  Mapper mapper(Frame{}, Models{}, options);
  for (int i = first; i < last; ++i) {
    RangeScan scan = wall_scan(i);
    scan.origin.y_m += 0.1 * i;
    for (auto& beam : scan.beams) {
      beam.from.y_m += 0.1 * i;
      beam.to.y_m += 0.1 * i;
    }
    mapper.add(scan);
  }
  return mapper.map();
}

/// Greatest difference of a mass.
float greatest_difference(const Map& a, const Map& b) {
  float most = 0;
  for (const auto& [key, patch] : a.by_key()) {
    for (const auto& [type, layer] : patch.layers) {
      const Layer* twin = b.find(patch.index, type);
      if (twin == nullptr) return 2;
      for (int c = 0; c < layer.channels(); ++c) {
        for (std::size_t i = 0; i < layer.cells(); ++i) {
          most = std::max(most, std::abs(layer.plane(c)[i] - twin->plane(c)[i]));
        }
      }
    }
  }
  return most;
}

TEST(MapperTest, TheMapsOfTwoHalvesFuseToTheMapOfTheWhole) {
  // Dempster's rule is associative: only the rounding of 2 x 20 steps is between them.
  MapperOptions options;
  options.min_unknown = 0;
  const Map whole = map_of(0, 40, options), first = map_of(0, 20, options), second = map_of(20, 40, options);
  const std::array<const Map*, 2> halves{&first, &second};
  const Map fused = fuse_maps(halves);
  EXPECT_EQ(fused.size(), whole.size());
  const float error = greatest_difference(whole, fused);
  EXPECT_LT(error, 2e-6f);

  // With a least m(Omega) evidence beyond it is cut off, earlier in the whole than in the halves: cells that
  // all scans agree on differ by no more than that.
  options.min_unknown = 0.02;
  const Map kept = map_of(0, 40, options), a = map_of(0, 20, options), b = map_of(20, 40, options);
  const std::array<const Map*, 2> others{&a, &b};
  EXPECT_LT(greatest_difference(kept, fuse_maps(others)), 0.021f);
}

TEST(MapperTest, MergedCellsKeepTheirUnknownMass) {
  Mapper mapper(Frame{}, Models{});
  mapper.set_profile(test::parking());  // 0.4 m
  mapper.move_to({5, 5}, 0);
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  Map wall(header);
  std::ranges::fill(wall.layer({0, 0}, 0, 5).plane(0), 0.9f);
  mapper.add(wall);
  EXPECT_FLOAT_EQ(cell_at(mapper.map(), {1, 1}).occupied, 0.9f);
  mapper.set_profile(test::road());  // 0.8 m: four cells of 0.9 would be one of 0.9999
  mapper.move_to({5, 5}, 1);
  EXPECT_FLOAT_EQ(cell_at(mapper.map(), {1, 1}).occupied, 0.98f);
}

TEST(MapperTest, TotalConflictIsCountedAndForgets) {
  MapperOptions options;
  options.min_unknown = 0;
  Mapper mapper(Frame{}, Models{}, options);
  mapper.add(even_map(1, 0));
  const MapperReport report = mapper.add(even_map(0, 1));
  EXPECT_EQ(report.total_conflicts, 16u);
  EXPECT_EQ(mapper.map().size(), 0u) << "a layer without data exists";

  Mapper careful(Frame{}, Models{});
  careful.add(even_map(1, 0));
  EXPECT_EQ(careful.add(even_map(0, 1)).total_conflicts, 0u);
  EXPECT_GT(cell_at(careful.map(), {1, 1}).free, 0.97f);
}

TEST(MapperTest, TrustDiscountsFirst) {
  Mapper mapper(Frame{}, Models{});
  mapper.add(even_map(0.5f, 0.25f), 0.5f);
  EXPECT_EQ(cell_at(mapper.map(), {1, 1}).occupied, 0.25f);
  EXPECT_EQ(cell_at(mapper.map(), {1, 1}).free, 0.125f);
  const Map before = mapper.map();
  EXPECT_EQ(mapper.add(wall_scan(0), 0).patches, 1u);
  EXPECT_EQ(difference(mapper.map(), before), "");
  for (const float bad : {-0.1f, 1.1f, std::numeric_limits<float>::quiet_NaN()}) {
    EXPECT_EQ(code_of([&] { mapper.add(wall_scan(0), bad); }), ErrorCode::kInvalidArgument);
  }
}

TEST(MapperTest, EvidenceIsForgottenAtTheGivenRate) {
  MapperOptions options;
  options.ageing_per_s = 0.8;
  for (const double seconds : {0.1, 1.0, 3.7, 12.0}) {
    Mapper mapper(Frame{}, Models{}, options);
    Map map = even_map(0.5f, 0.25f);
    mapper.move_to({0, 0}, kSecond);
    mapper.add(map);
    mapper.move_to({0, 0}, kSecond + static_cast<std::int64_t>(seconds * 1e9));
    const double left = std::pow(0.8, seconds);
    const Cell cell = cell_at(mapper.map(), {1, 1});
    EXPECT_NEAR(cell.occupied, 0.5 * left, 0.5 * left * 0.0101 + 1e-6) << seconds;
    EXPECT_GE(cell.occupied, 0.5 * left * (1 - 1e-4)) << seconds;
    EXPECT_NEAR(cell.free, 0.25 * left, 0.25 * left * 0.0101) << seconds;
  }
}

TEST(MapperTest, WhatHasFadedIsGone) {
  MapperOptions options;
  options.ageing_per_s = 0.5;
  Mapper mapper(Frame{}, Models{}, options);
  mapper.add(wall_scan(0));
  mapper.take_changes();
  mapper.move_to({0, 0}, 60 * kSecond);
  EXPECT_EQ(mapper.map().size(), 0u);
  EXPECT_FALSE(mapper.take_changes().gone.empty());
}

TEST(MapperTest, TimesThatGoBackAreTheLastTime) {
  MapperOptions options;
  options.ageing_per_s = 0.5;
  Mapper late(Frame{}, Models{}, options), same(Frame{}, Models{}, options);
  for (Mapper* mapper : {&late, &same}) mapper->add(wall_scan(10 * kSecond));
  late.add(wall_scan(-20 * kSecond));
  same.add(wall_scan(10 * kSecond));
  for (Mapper* mapper : {&late, &same}) mapper->move_to({0, 0}, 11 * kSecond);
  EXPECT_EQ(difference(late.map(), same.map()), "");
}

TEST(MapperTest, ForeignLayersAreTakenByNameAndNewTypesAdded) {
  Mapper mapper(Frame{}, Models{}, coarse_options());
  mapper.add(wall_scan(0));
  const Cell front = cell_at(mapper.map(), {2.55, 0.05});
  MapHeader header;
  header.types =
      TypeTable({LayerType::occupancy("aaa", Policy::kExclusive), LayerType::real("height", {"z"})});
  Map foreign(header);
  foreign.layer({0, 0}, 0, 3).plane(0)[5] = 0.5f;
  foreign.layer({7, 7}, 1, 2).plane(0)[1] = 4.5f;
  mapper.add(foreign);
  const TypeTable& types = mapper.map().header().types;
  ASSERT_EQ(types.size(), 4u);
  EXPECT_EQ(types[*types.find("aaa")].policy, Policy::kConditional);
  EXPECT_EQ(mapper.map().find({0, 0}, *types.find("aaa"))->plane(0)[5], 0.5f);
  EXPECT_EQ(mapper.map().find({7, 7}, *types.find("height"))->plane(0)[1], 4.5f);
  EXPECT_EQ(cell_at(mapper.map(), {2.55, 0.05}).free, front.free);
  mapper.add(wall_scan(0));
  EXPECT_GT(cell_at(mapper.map(), {2.55, 0.05}).free, front.free);

  header.frame.datum_x_um = 1;
  EXPECT_EQ(code_of([&] { mapper.add(Map(header)); }), ErrorCode::kIncompatible);
  header.frame.datum_x_um = 0;
  header.types = TypeTable({LayerType::semantic("height", {"low", "high"})});
  EXPECT_EQ(code_of([&] { mapper.add(Map(header)); }), ErrorCode::kIncompatible);
}

TEST(MapperTest, FinerForeignLayersMakeThePatchFiner) {
  Mapper mapper(Frame{}, Models{}, coarse_options());
  mapper.add(wall_scan(0));
  const MapperReport report = mapper.add(even_map(0.5f, 0.0f, 6));
  EXPECT_EQ(report.layers_resampled, 1u);
  EXPECT_EQ(mapper.map().find({0, 0}, *mapper.map().header().types.find("occupancy"))->step(), 6);
  mapper.add(wall_scan(1));
  EXPECT_EQ(mapper.map().find({0, 0}, *mapper.map().header().types.find("occupancy"))->step(), 6);
}

TEST(MapperTest, ReportsWhatTheMapHolds) {
  Mapper mapper(Frame{}, Models{}, coarse_options());
  test::drive(mapper, 3, {}, [&] {
    const MapperReport report = mapper.move_to({0, 0}, 0);
    const Summary summary = mapper.map().summary();
    ASSERT_EQ(report.patches, summary.patches);
    ASSERT_EQ(report.types.size(), summary.types.size());
    for (std::size_t t = 0; t < summary.types.size(); ++t) {
      ASSERT_EQ(report.types[t].layers, summary.types[t].layers);
      ASSERT_EQ(report.types[t].bytes, summary.types[t].raw_bytes);
    }
  });
}

TEST(MapperTest, MassesStayValid) {
  for (const Rule rule : {Rule::kDempster, Rule::kYager, Rule::kMean, Rule::kMax, Rule::kLast}) {
    MapperOptions options = coarse_options();
    options.rule = rule;
    options.ageing_per_s = 0.9;
    Mapper mapper(Frame{}, Models{}, options);
    test::drive(mapper, 11, {}, [&] {
      for (const auto& [key, patch] : mapper.map().by_key()) {
        for (const auto& [type, layer] : patch.layers) {
          ASSERT_TRUE(is_canonical(layer, mapper.map().header().types[type])) << to_string(rule);
          ASSERT_FALSE(is_vacuous(layer, mapper.map().header().types[type]));
        }
      }
    });
  }
}

TEST(MapperTest, OptionsOutOfRangeAreRefused) {
  std::vector<MapperOptions> bad(7);
  bad[0].ageing_per_s = 0;
  bad[1].ageing_per_s = 1.5;
  bad[2].min_unknown = 1;
  bad[3].min_unknown = -0.1;
  bad[4].cell_m = 0;
  bad[5].max_memory_bytes = 1;
  bad[6].min_unknown = 0.51;
  for (const MapperOptions& options : bad) {
    EXPECT_EQ(code_of([&] { const Mapper mapper(Frame{}, Models{}, options); }), ErrorCode::kInvalidArgument);
  }
  Mapper mapper(Frame{}, Models{});
  EXPECT_EQ(code_of([&] { mapper.flush(); }), ErrorCode::kInvalidArgument);
  mapper.set_profile(test::parking());
  EXPECT_EQ(code_of([&] { mapper.add(wall_scan(0)); }), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code_of([&] { mapper.add(LabelledGround{}); }), ErrorCode::kInvalidArgument);
}

TEST(MapperTest, WithAProfileForeignLayersNeedAPositionToo) {
  Mapper mapper(Frame{}, Models{});
  mapper.set_profile(test::parking());
  Map foreign = even_map(0.5f, 0);
  const TypeTable before = mapper.map().header().types;
  EXPECT_EQ(code_of([&] { mapper.add(foreign); }), ErrorCode::kInvalidArgument);
  EXPECT_EQ(mapper.map().header().types, before);
  mapper.move_to({0, 0}, 0);
  mapper.add(foreign);
  EXPECT_EQ(mapper.map().size(), 1u);
}

TEST(MapperTest, NoRuleLeavesLayersWithoutData) {
  for (const Rule rule : {Rule::kDempster, Rule::kYager, Rule::kMean, Rule::kMax, Rule::kLast}) {
    MapperOptions options;
    options.rule = rule;
    options.min_unknown = 0;
    Mapper mapper(Frame{}, Models{}, options);
    mapper.add(even_map(1, 0));
    mapper.add(even_map(0, 1));
    // A mass that vanishes when it is divided.
    Map tiny = even_map(std::numeric_limits<float>::denorm_min(), 0);
    mapper.add(tiny, 0.25f);
    for (const auto& [key, patch] : mapper.map().by_key()) {
      for (const auto& [type, layer] : patch.layers) {
        EXPECT_FALSE(is_vacuous(layer, mapper.map().header().types[type])) << to_string(rule);
      }
    }
  }
}

TEST(MapperTest, TakesAnyTime) {
  constexpr auto kFirst = std::numeric_limits<std::int64_t>::min();
  constexpr auto kLast = std::numeric_limits<std::int64_t>::max();
  for (const double ageing : {1.0, 0.5}) {
    MapperOptions options;
    options.ageing_per_s = ageing;
    Mapper mapper(Frame{}, Models{}, options);
    mapper.add(wall_scan(kFirst));
    EXPECT_GT(mapper.map().size(), 0u);
    mapper.move_to({0, 0}, kLast);
    EXPECT_EQ(mapper.map().size() > 0, ageing == 1.0);
  }
}

}  // namespace
}  // namespace apgm
