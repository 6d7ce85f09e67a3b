#include "scene/paper_drive.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <set>
#include <string>
#include <vector>

#include "fingerprint.hpp"
#include "scene/scene.hpp"

namespace apgm::samples {
namespace {

std::string text_of(const std::string& name) {
  std::ifstream file(std::string(APGM_SAMPLE_PROFILES) + "/" + name);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

Models models() { return parse_models(text_of("models.yaml"), "models.yaml"); }
Schedule schedule() { return parse_profiles(text_of("paper_drive.yaml"), "paper_drive.yaml"); }

/// Steps of the layers named so, and the distance of the farthest patch that has one.
struct Extent {
  std::set<int> steps;
  double farthest_m = 0;
};
Extent extent_of(const Map& map, const std::string& name, Point vehicle) {
  Extent extent;
  const Frame& frame = map.header().frame;
  const TypeId type = map.header().types.find(name).value();
  for (const auto& [key, patch] : map.by_key()) {
    const auto it = patch.layers.find(type);
    if (it == patch.layers.end()) continue;
    extent.steps.insert(it->second.step());
    const Box box = frame.box_m(patch.index);
    const double dx = std::max({0.0, box.min.x_m - vehicle.x_m, vehicle.x_m - box.max.x_m});
    const double dy = std::max({0.0, box.min.y_m - vehicle.y_m, vehicle.y_m - box.max.y_m});
    extent.farthest_m = std::max(extent.farthest_m, std::hypot(dx, dy));
  }
  return extent;
}

TEST(PaperDriveTest, ProfilesAreThoseOfThePaper) {
  const Schedule all = schedule();
  ASSERT_EQ(all.entries.size(), 3u);
  EXPECT_EQ(all.entries[1].from_s, 156);
  EXPECT_EQ(all.entries[2].from_s, 340);
  const TypeTable types({models().occupancy_type(), models().semantic_type()});
  for (const auto& entry : all.entries) EXPECT_NO_THROW(entry.profile.check(sample_frame(), types));
  const Profile& road = all.at(200);
  ASSERT_EQ(road.requirements.size(), 2u);
  EXPECT_EQ(std::get<Ring>(road.requirements[0].area).to_m, 100);
  EXPECT_EQ(road.requirements[0].cell_m, 0.2);
  EXPECT_EQ(std::get<Ring>(road.requirements[1].area).to_m, 40);
  EXPECT_EQ(std::get<Ring>(all.at(400).requirements[0].area).to_m, 20);
  EXPECT_EQ(all.at(400).requirements[0].cell_m, 0.1);
}

TEST(PaperDriveTest, HorizonAndResolutionChangeWithinOneStep) {
  int steps = 0;
  const auto on_step = [&](const DriveStep& step, const Map& map) {
    SCOPED_TRACE(step.time_s);
    ++steps;
    const Extent occupancy = extent_of(map, "occupancy", step.vehicle);
    const Extent semantics = extent_of(map, "semantics", step.vehicle);
    if (step.time_s < 155.95) {
      EXPECT_EQ(step.profile, "parking");
      EXPECT_EQ(occupancy.steps, std::set<int>{7});
      EXPECT_LE(occupancy.farthest_m, 20);
      EXPECT_TRUE(semantics.steps.empty());
    } else {
      EXPECT_EQ(step.profile, "road");
      EXPECT_EQ(occupancy.steps, std::set<int>{6});
      EXPECT_GT(occupancy.farthest_m, 80);
      EXPECT_LE(occupancy.farthest_m, 100);
      EXPECT_EQ(semantics.steps, std::set<int>{6});
      EXPECT_GT(semantics.farthest_m, 15);
      EXPECT_LE(semantics.farthest_m, 40);
    }
  };
  run_paper_drive({.from_s = 155.5, .seconds = 1}, models(), schedule(), on_step);
  EXPECT_EQ(steps, 10);
}

TEST(PaperDriveTest, NoCellIsLostInsideTheNewHorizon) {
  // What is known within 20 m before the switch to parking is known after it, at the finer resolution.
  std::vector<Map> maps;
  Point vehicle;
  run_paper_drive({.from_s = 338, .seconds = 2.1}, models(), schedule(),
                  [&](const DriveStep& step, const Map& map) {
                    if (step.time_s < 339.85) return;
                    maps.push_back(map);
                    vehicle = step.vehicle;
                  });
  ASSERT_EQ(maps.size(), 2u);
  const Frame& frame = maps[0].header().frame;
  const TypeId type = maps[0].header().types.find("occupancy").value();
  std::size_t known = 0;
  for (double dx = -14; dx < 14; dx += 0.1) {
    for (double dy = -14; dy < 14; dy += 0.1) {
      const Point p = vehicle + Point{dx, dy};
      const auto before = frame.cell_at(p, 6);
      const auto after = frame.cell_at(p, 7);
      const Layer* road = maps[0].find(before.patch, type);
      if (road == nullptr) continue;
      if (road->at(0, before.cell) + road->at(1, before.cell) < 0.1f) continue;
      ++known;
      const Layer* parking = maps[1].find(after.patch, type);
      ASSERT_NE(parking, nullptr);
      EXPECT_EQ(parking->step(), 7);
      EXPECT_GT(parking->at(0, after.cell) + parking->at(1, after.cell), 0.0f);
    }
  }
  EXPECT_GT(known, 10'000u);
}

TEST(PaperDriveTest, SameSeedGivesTheSameCells) {
  const auto run = [](std::uint64_t seed) {
    std::vector<std::uint64_t> prints;
    run_paper_drive({seed, 155.8, 0.5}, models(), schedule(),
                    [&](const DriveStep&, const Map& map) { prints.push_back(fingerprint(map)); });
    return prints;
  };
  EXPECT_EQ(run(1), run(1));
  EXPECT_NE(run(1), run(2));
}

TEST(PaperDriveTest, CountsAllocatedAndKnownCells) {
  run_paper_drive({.from_s = 170, .seconds = 0.5}, models(), schedule(),
                  [&](const DriveStep& step, const Map& map) {
                    std::uint64_t occupancy = 0;
                    std::uint64_t semantics = 0;
                    for (const auto& [key, patch] : map.by_key()) {
                      for (const auto& [type, layer] : patch.layers) {
                        (map.header().types[type].is_occupancy() ? occupancy : semantics) += layer.cells();
                      }
                    }
                    EXPECT_EQ(step.patches, map.size());
                    EXPECT_EQ(step.occupancy.cells, occupancy);
                    EXPECT_EQ(step.semantics.cells, semantics);
                    EXPECT_EQ(step.occupancy.bytes, 8 * occupancy);
                    EXPECT_EQ(step.semantics.bytes, 16 * semantics);
                    EXPECT_GT(step.occupancy.known, occupancy / 20);
                    EXPECT_LT(step.occupancy.known, occupancy);
                    EXPECT_GT(step.semantics.known, semantics / 50);
                    EXPECT_LT(step.semantics.known, semantics);
                  });
}

TEST(PaperDriveTest, HoldsAboutAsManyCellsAsThePapersMap) {
  // Means of the paper: parking 243k; road 345k and 88k. Here over a stretch of each phase.
  struct Mean {
    double occupancy = 0, semantics = 0, steps = 0;
  };
  const auto mean_of = [](double from_s, double warm_up_s, double seconds) {
    Mean mean;
    const PaperDriveOptions options{.from_s = from_s - warm_up_s, .seconds = warm_up_s + seconds};
    run_paper_drive(options, models(), schedule(), [&](const DriveStep& step, const Map&) {
      if (step.time_s < from_s) return;
      mean.occupancy += static_cast<double>(step.occupancy.cells);
      mean.semantics += static_cast<double>(step.semantics.cells);
      mean.steps += 1;
    });
    return mean;
  };
  for (const double from_s : {30.0, 395.0}) {
    const Mean parking = mean_of(from_s, 2, 4);
    EXPECT_NEAR(parking.occupancy / parking.steps, 243e3, 35e3) << from_s;
    EXPECT_EQ(parking.semantics, 0) << from_s;
  }
  const Mean road = mean_of(240, 8, 4);
  EXPECT_NEAR(road.occupancy / road.steps, 345e3, 80e3);
  EXPECT_NEAR(road.semantics / road.steps, 88e3, 25e3);
}

TEST(PaperDriveTest, EndsWithTheDrive) {
  std::vector<double> times;
  const auto on_step = [&](const DriveStep& step, const Map&) { times.push_back(step.time_s); };
  run_paper_drive({.from_s = 464.7, .seconds = 100}, models(), schedule(), on_step);
  ASSERT_EQ(times.size(), 3u);
  EXPECT_NEAR(times.back(), 464.9, 1e-9);
  run_paper_drive({.from_s = 1000}, models(), schedule(), on_step);
  EXPECT_EQ(times.size(), 3u);
}

}  // namespace
}  // namespace apgm::samples
