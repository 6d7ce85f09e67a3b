#include "scene/lot_maps.hpp"

#include <gtest/gtest.h>

#include <cstdint>

#include "fingerprint.hpp"
#include "scene/lot.hpp"

namespace apgm::samples {
namespace {

/// A drive with a fourth of its measurements, so that the tests stay quick.
Drive thinned(Drive drive) {
  Drive few{{}, drive.start_ns, drive.period_ns};
  for (std::size_t i = 0; i < drive.poses.size(); i += 4) few.poses.push_back(drive.poses[i]);
  return few;
}

/// Visits the cells of one type: visit(layer, index in plane, centre in scene metres).
template <class Visit>
void for_each_cell(const Scene& scene, const Map& map, const char* type_name, Visit visit) {
  const TypeId type = map.header().types.find(type_name).value();
  const Frame& frame = map.header().frame;
  for (const auto& [key, patch] : map.by_key()) {
    const auto it = patch.layers.find(type);
    if (it == patch.layers.end()) continue;
    const Layer& layer = it->second;
    const Point corner = scene.from_map(frame.origin_m(patch.index));
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

TEST(MapDriveTest, SameSeedGivesTheSameCells) {
  const Scene scene = lot_scene();
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
  const Scene scene = lot_scene();
  const Map map = map_drive(scene, thinned(drive_a()), "a", 102).vehicle;
  std::size_t occupied = 0, occupied_near = 0, free = 0, free_wrong = 0;
  for_each_cell(scene, map, "occupancy", [&](const Layer& layer, std::size_t k, Point p) {
    const float o = layer.plane(0)[k];
    const float f = layer.plane(1)[k];
    ASSERT_LE(o + f, 0.98f + 1e-6f);  // something is always left to be learnt
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
  const Scene scene = lot_scene();
  const Map map = map_drive(scene, thinned(drive_a()), "a", 102).vehicle;
  std::size_t inside = 0;
  for_each_cell(scene, map, "occupancy", [&](const Layer& layer, std::size_t k, Point p) {
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
  const Scene scene = lot_scene();
  const Map map = map_drive(scene, thinned(drive_a()), "a", 102).vehicle;
  const Frame& frame = map.header().frame;
  const TypeId type = map.header().types.find("occupancy").value();
  int seen = 0;
  constexpr int kColumns = 100;
  for (int n = 0; n < kColumns; ++n) {
    const double x_m = 80.05 + 0.1 * n;
    bool wall = false;
    for (double y_m = 60.85; y_m < 61.2; y_m += 0.1) {
      const auto at = frame.cell_at(scene.in_map({x_m, y_m}), frame.step_for(0.1));
      const Layer* layer = map.find(at.patch, type);
      wall = wall || (layer != nullptr && layer->at(0, at.cell) > layer->at(1, at.cell));
    }
    seen += wall;
  }
  EXPECT_GT(seen, kColumns / 2);
}

TEST(MapDriveTest, LabelsTheGround) {
  const Scene scene = lot_scene();
  Drive drive = drive_b();
  drive.poses.resize(20);  // past the crossing, every frame: labels need many pixels
  const Map map = map_drive(scene, drive, "b", 203).vehicle;
  std::size_t sure = 0, right = 0, markings = 0;
  for_each_cell(scene, map, "semantics", [&](const Layer& layer, std::size_t k, Point p) {
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
  const Scene scene = lot_scene();
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
  const Scene scene = lot_scene();
  Drive drive = drive_a();
  drive.poses.resize(1);
  const Map scan = map_drive(scene, drive, "a", 102).first_scan;
  EXPECT_EQ(scan.header().types[0].policy, Policy::kExclusive);
  std::size_t known = 0;
  for_each_cell(scene, scan, "occupancy", [&](const Layer& layer, std::size_t k, Point) {
    const float o = layer.plane(0)[k];
    const float f = layer.plane(1)[k];
    EXPECT_TRUE(o == 0 || f == 0);
    known += o > 0 || f > 0;
  });
  EXPECT_GT(known, 3000u);
}

TEST(TruthMapTest, IsTheScene) {
  const Scene scene = lot_scene();
  const Map truth = truth_map(scene);
  std::size_t cells = 0;
  for_each_cell(scene, truth, "occupancy", [&](const Layer& layer, std::size_t k, Point p) {
    if (!contains(scene.bounds(), p)) {
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
