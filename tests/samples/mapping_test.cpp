#include "scene/mapping.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cstdint>

#include "scene/grid.hpp"

namespace apgm::samples {
namespace {

/// FNV-1a over places, steps and the bits of all cells.
std::uint64_t fingerprint(const Map& map) {
  std::uint64_t hash = 0xcbf29ce484222325;
  const auto add = [&](std::uint32_t word) { hash = (hash ^ word) * 0x100000001b3; };
  for (const auto& [key, patch] : map.by_key()) {
    add(static_cast<std::uint32_t>(patch.index.x));
    add(static_cast<std::uint32_t>(patch.index.y));
    for (const auto& [type, layer] : patch.layers) {
      add(type);
      add(static_cast<std::uint32_t>(layer.step()));
      for (int c = 0; c < layer.channels(); ++c) {
        for (const float v : layer.plane(c)) add(std::bit_cast<std::uint32_t>(v));
      }
    }
  }
  return hash;
}

/// A drive with a fourth of its measurements, so that the tests stay quick.
Drive thinned(Drive drive) {
  Drive few{{}, drive.start_ns, drive.period_ns};
  for (std::size_t i = 0; i < drive.poses.size(); i += 4) few.poses.push_back(drive.poses[i]);
  return few;
}

/// Visits the cells of one type: visit(layer, index in plane, centre in scene metres).
template <class Visit>
void for_each_cell(const Map& map, const char* type_name, Visit visit) {
  const TypeId type = map.header().types.find(type_name).value();
  const Frame& frame = map.header().frame;
  for (const auto& [key, patch] : map.by_key()) {
    const auto it = patch.layers.find(type);
    if (it == patch.layers.end()) continue;
    const Layer& layer = it->second;
    const Point corner = frame.origin_m(patch.index) - frame.datum_m() - kSceneCorner_m;
    const double cell_m = frame.cell_m(layer.step());
    for (std::size_t k = 0; k < layer.cells(); ++k) {
      const auto a = static_cast<double>(k % static_cast<std::size_t>(layer.side()));
      const auto b = static_cast<double>(k / static_cast<std::size_t>(layer.side()));
      visit(layer, k, corner + cell_m * Point{a + 0.5, b + 0.5});
    }
  }
}

/// True if an obstacle lies within 0.15 m, measurement noise and the half of a cell.
bool near_obstacle(const Scene& scene, Point p) {
  for (int dx = -2; dx <= 2; ++dx) {
    for (int dy = -2; dy <= 2; ++dy) {
      if (scene.occupied(p + Point{0.075 * dx, 0.075 * dy})) return true;
    }
  }
  return false;
}

TEST(OccupancyOfTest, FillsCellsAlongABeam) {
  LidarScan scan;
  scan.origin = Point{1.05, 1.05} - kSceneCorner_m;
  scan.max_range_m = 60;
  scan.beams = {{scan.origin + Point{3, 0}, true}, {scan.origin + Point{0, 2}, false}};
  const Map map = occupancy_of(scan);
  ASSERT_EQ(map.size(), 1u);
  EXPECT_EQ(map.header().types[0].policy, Policy::kExclusive);
  const Layer& layer = *map.find({0, 0}, 0);
  EXPECT_EQ(layer.at(0, {40, 10}), 0.7f);  // the hit: in the cell's centre
  EXPECT_EQ(layer.at(1, {40, 10}), 0.0f);
  EXPECT_EQ(layer.at(0, {41, 10}), 0.0f);  // behind it
  EXPECT_EQ(layer.at(1, {41, 10}), 0.0f);
  EXPECT_EQ(layer.at(1, {10, 10}), 0.5f);  // the sensor's own cell
  EXPECT_NEAR(layer.at(1, {25, 10}), 0.5 * (1 - 1.5 / 60), 1e-6);
  for (int a = 11; a < 40; ++a) EXPECT_LT(layer.at(1, {a, 10}), layer.at(1, {a - 1, 10}));
  EXPECT_GT(layer.at(1, {10, 29}), 0.4f);  // a beam that hit nothing: free up to its end
  EXPECT_EQ(layer.at(0, {10, 30}), 0.0f);
}

TEST(SemanticsOfTest, AddsEvidenceOfPixels) {
  const Point p = Point{0.3, 0.3} - kSceneCorner_m;
  const Point q = Point{0.7, 0.3} - kSceneCorner_m;
  const Map map = semantics_of({{{p, Ground::kRoad},
                                 {p, Ground::kRoad},
                                 {p, Ground::kRoad},
                                 {p, Ground::kMarking},
                                 {q, Ground::kBlocked}},
                                5});
  const Layer& layer = *map.find({0, 0}, 0);
  EXPECT_EQ(layer.stamp_ns, 5);
  const double omega = 0.94 * 0.94 * 0.94 * 0.94;
  EXPECT_NEAR(layer.at(0, {1, 1}), 0.75 * (1 - omega), 1e-7);
  EXPECT_NEAR(layer.at(1, {1, 1}), 0.25 * (1 - omega), 1e-7);
  EXPECT_EQ(layer.at(2, {1, 1}), 0.0f);
  EXPECT_NEAR(layer.at(3, {1, 1}), omega, 1e-7);
  EXPECT_NEAR(layer.at(2, {3, 1}), 0.06, 1e-7);
  EXPECT_EQ(layer.at(3, {0, 0}), 1.0f);
}

TEST(TimeFusionTest, NeverBecomesCertain) {
  LidarScan scan;
  scan.origin = Point{1.05, 1.05} - kSceneCorner_m;
  scan.max_range_m = 60;
  scan.beams = {{scan.origin + Point{3, 0}, true}};
  const Map measurement = occupancy_of(scan);
  MapHeader header;
  header.frame = sample_frame();
  header.types = TypeTable({occupancy_type(Policy::kConditional)});
  TimeFusion fusion(header);
  for (int i = 0; i < 5000; ++i) {
    fusion.age(0.993f);
    fusion.add(measurement);
  }
  const Layer& layer = *fusion.map().find({0, 0}, 0);
  EXPECT_GT(layer.at(0, {40, 10}), 0.99f);
  EXPECT_LT(layer.at(0, {40, 10}), 1.0f);
  EXPECT_LT(layer.at(1, {20, 10}), 1.0f);
}

TEST(MapDriveTest, SameSeedGivesTheSameCells) {
  const Scene scene;
  Drive drive = thinned(drive_b());
  drive.poses.resize(3);
  const auto once = map_drive(scene, drive, "b", 9);
  const auto again = map_drive(scene, drive, "b", 9);
  const auto other = map_drive(scene, drive, "b", 10);
  EXPECT_EQ(fingerprint(once.vehicle), fingerprint(again.vehicle));
  EXPECT_EQ(fingerprint(once.first_scan), fingerprint(again.first_scan));
  EXPECT_NE(fingerprint(once.vehicle), fingerprint(other.vehicle));
}

TEST(MapDriveTest, DrawsWhatIsThere) {
  const Scene scene;
  const Map map = map_drive(scene, thinned(drive_a()), "a", 102).vehicle;
  std::size_t occupied = 0, occupied_near = 0, free = 0, free_wrong = 0;
  for_each_cell(map, kOccupancy, [&](const Layer& layer, std::size_t k, Point p) {
    const float o = layer.plane(0)[k];
    const float f = layer.plane(1)[k];
    ASSERT_LT(o + f, 1.0f);
    if (scene.hidden(p)) {
      ASSERT_EQ(o + f, 0.0f) << "inside a building at " << p.x_m << ", " << p.y_m;
    }
    if (o > f) {
      ++occupied;
      occupied_near += near_obstacle(scene, p);
    }
    if (f > 0.5f) {
      ++free;
      free_wrong += scene.occupied(p);
    }
  });
  EXPECT_GT(occupied, 3000u);
  EXPECT_GT(static_cast<double>(occupied_near), 0.999 * static_cast<double>(occupied));
  EXPECT_GT(free, 50000u);
  EXPECT_LT(static_cast<double>(free_wrong), 0.002 * static_cast<double>(free));
}

TEST(MapDriveTest, LeavesTheInsideOfCarsUnknown) {
  const Scene scene;
  const Map map = map_drive(scene, thinned(drive_a()), "a", 102).vehicle;
  std::size_t inside = 0;
  for_each_cell(map, kOccupancy, [&](const Layer& layer, std::size_t k, Point p) {
    for (Rect core : scene.cars()) {
      core.half = core.half - Point{0.25, 0.25};
      if (!contains(core, p)) continue;
      ++inside;
      EXPECT_EQ(layer.plane(0)[k] + layer.plane(1)[k], 0.0f) << p.x_m << ", " << p.y_m;
    }
  });
  EXPECT_GT(inside, 10000u);
}

TEST(MapDriveTest, SeesTheWallBehindTheArcade) {
  const Scene scene;
  const Map map = map_drive(scene, thinned(drive_a()), "a", 102).vehicle;
  const Frame& frame = map.header().frame;
  const TypeId type = map.header().types.find(kOccupancy).value();
  int seen = 0;
  constexpr int kColumns = 100;
  for (int n = 0; n < kColumns; ++n) {
    const double x_m = 80.05 + 0.1 * n;
    bool wall = false;
    for (double y_m = 60.85; y_m < 61.2; y_m += 0.1) {
      const auto at = frame.cell_at(frame.datum_m() + kSceneCorner_m + Point{x_m, y_m}, kLidarStep);
      const Layer* layer = map.find(at.patch, type);
      wall = wall || (layer != nullptr && layer->at(0, at.cell) > layer->at(1, at.cell));
    }
    seen += wall;
  }
  EXPECT_GT(seen, kColumns / 2);
}

TEST(MapDriveTest, LabelsTheGround) {
  const Scene scene;
  Drive drive = drive_b();
  drive.poses.resize(20);  // past the crossing, every frame: labels need many pixels
  const Map map = map_drive(scene, drive, "b", 203).vehicle;
  std::size_t sure = 0, right = 0, markings = 0;
  for_each_cell(map, kSemantics, [&](const Layer& layer, std::size_t k, Point p) {
    for (int c = 0; c < 3; ++c) {
      if (layer.plane(c)[k] <= 0.7f) continue;
      ++sure;
      right += static_cast<int>(scene.ground(p)) == c;
      markings += c == static_cast<int>(Ground::kMarking);
    }
  });
  EXPECT_GT(sure, 5000u);
  EXPECT_GT(markings, 100u);
  EXPECT_GT(static_cast<double>(right), 0.9 * static_cast<double>(sure));
}

TEST(MapDriveTest, MassesAreValid) {
  const Scene scene;
  Drive drive = drive_a();
  drive.poses.resize(4);
  const auto maps = map_drive(scene, drive, "a", 102);
  for (const Map* map : {&maps.vehicle, &maps.front, &maps.rear, &maps.first_scan}) {
    EXPECT_GT(map->size(), 0u);
    for (const auto& [key, patch] : map->by_key()) {
      for (const auto& [type, layer] : patch.layers) {
        Layer copy = layer;
        EXPECT_NO_THROW(canonicalise(copy, map->header().types[type]));
      }
    }
  }
}

TEST(MapDriveTest, ScansHoldFreeOrOccupiedEvidenceNeverBoth) {
  const Scene scene;
  Drive drive = drive_a();
  drive.poses.resize(1);
  const Map scan = map_drive(scene, drive, "a", 102).first_scan;
  EXPECT_EQ(scan.header().types[0].policy, Policy::kExclusive);
  std::size_t known = 0;
  for_each_cell(scan, kOccupancy, [&](const Layer& layer, std::size_t k, Point) {
    const float o = layer.plane(0)[k];
    const float f = layer.plane(1)[k];
    EXPECT_TRUE(o == 0 || f == 0);
    known += o > 0 || f > 0;
  });
  EXPECT_GT(known, 3000u);
}

TEST(TruthMapTest, IsTheScene) {
  const Scene scene;
  const Map truth = truth_map(scene);
  std::size_t cells = 0;
  for_each_cell(truth, kOccupancy, [&](const Layer& layer, std::size_t k, Point p) {
    if (!contains(Scene::kBounds, p)) {
      EXPECT_EQ(layer.plane(0)[k] + layer.plane(1)[k], 0.0f);
      return;
    }
    ++cells;
    const bool hidden = scene.hidden(p);
    const bool occupied = scene.occupied(p);
    EXPECT_EQ(layer.plane(0)[k], !hidden && occupied ? 0.98f : 0.0f);
    EXPECT_EQ(layer.plane(1)[k], !hidden && !occupied ? 0.98f : 0.0f);
  });
  EXPECT_EQ(cells, 1200u * 800u);
}

}  // namespace
}  // namespace apgm::samples
