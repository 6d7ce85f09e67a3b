#include <cmath>

#include "tests/converters/octomap_support.hpp"

namespace apgm::converters {
namespace {

using testing::collect;
using testing::open;

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::key;
using testing::masses_at;

constexpr float kHit = 2.1972246f;    // p = 0.9
constexpr float kMiss = -1.3862944f;  // p = 0.2

std::string small_tree(const testing::TempDir& dir) {
  ::octomap::OcTree tree(0.1);
  tree.setNodeValue(key(0, 0, 0), kHit);
  tree.setNodeValue(key(0, 0, 1), kMiss);
  tree.setNodeValue(key(0, 0, 2), kMiss);
  tree.setNodeValue(key(-1, 0, 0), kMiss);
  tree.setNodeValue(key(-1, 0, -3), kMiss);
  tree.setNodeValue(key(5, 5, 1), kHit);
  tree.setNodeValue(key(5, 5, 2), kHit);
  return testing::save_ot(tree, dir / "small.ot");
}

TEST(OctomapProjection, JoinsColumnsByOr) {
  const testing::TempDir dir;
  const Map map = collect(*open(octomap(), small_tree(dir)));
  EXPECT_EQ(map.header().frame.edge_um, 12'800'000);
  EXPECT_EQ(map.header().metadata.at("octomap.resolution"), "0.1");
  const auto [o, f] = masses_at(map, "occupancy", 0.05, 0.05, 7);
  EXPECT_NEAR(o, 0.8, 1e-6);
  EXPECT_NEAR(f, 0.2 * (0 + 0.6 + 0.6) / 3, 1e-6);
  const auto [o1, f1] = masses_at(map, "occupancy", -0.05, 0.05, 7);
  EXPECT_EQ(o1, 0);
  EXPECT_NEAR(f1, 0.6, 1e-6);
  EXPECT_NEAR(masses_at(map, "occupancy", 0.55, 0.55, 7).first, 1 - 0.2 * 0.2, 1e-6);
  EXPECT_EQ(masses_at(map, "occupancy", 0.15, 0.05, 7), std::pair(0.0f, 0.0f));
}

TEST(OctomapProjection, HeightsAreVoxelCentres) {
  const testing::TempDir dir;
  const std::string path = small_tree(dir);
  const Map high = collect(*open(octomap(), path, {{"z_min", "0.1"}, {"z_max", "0.2"}}));
  EXPECT_EQ(masses_at(high, "occupancy", 0.05, 0.05, 7).first, 0);
  EXPECT_NEAR(masses_at(high, "occupancy", 0.05, 0.05, 7).second, 0.6, 1e-6);
  EXPECT_NEAR(masses_at(high, "occupancy", 0.55, 0.55, 7).first, 0.8, 1e-6);
  const Map low = collect(*open(octomap(), path, {{"z_max", "0"}}));
  EXPECT_EQ(low.size(), 1u);
  const Map none = collect(*open(octomap(), path, {{"z_min", "50"}}));
  EXPECT_EQ(none.size(), 0u);
}

TEST(OctomapProjection, PrunedLeavesCoverAllTheirColumns) {
  const testing::TempDir dir;
  // A root with one child: the eighth of the cube with all coordinates below the origin.
  const std::string path = testing::write_text(
      dir / "big.ot", testing::tree_file(false, testing::node(0, 1) + testing::node(kHit, 0), 2));
  const auto source = open(octomap(), path);
  EXPECT_EQ(source->summary().patches, 256u * 256u);
  PatchInfo patch;
  const auto cursor = source->patches(PatchRange{{-3, -2}, {5, 5}});
  int patches = 0;
  while (cursor->next(patch)) ++patches;
  EXPECT_EQ(patches, 3 * 2);
  Layer layer;
  LayerInfo info;
  info.patch = {-1, -1};
  source->load(info, layer);
  EXPECT_EQ(layer.at(0, {0, 0}), 1.0f) << "32768 voxels above each other";
  EXPECT_EQ(layer.at(0, {127, 127}), 1.0f);
}

TEST(OctomapSlices, AreNamedByKeyAndSortByHeight) {
  const testing::TempDir dir;
  const Map map = collect(*open(octomap(), small_tree(dir), {{"mode", "slices"}}));
  std::vector<std::string> names;
  for (const auto& type : map.header().types) names.push_back(type.name);
  EXPECT_THAT(names,
              ElementsAre("occupancy_z32765", "occupancy_z32768", "occupancy_z32769", "occupancy_z32770"));
  EXPECT_EQ(map.header().types[0].slab, (Slab{-300'000, -200'000}));
  EXPECT_NEAR(masses_at(map, "occupancy_z32768", 0.05, 0.05, 7).first, 0.8, 1e-6);
  EXPECT_NEAR(masses_at(map, "occupancy_z32765", -0.05, 0.05, 7).second, 0.6, 1e-6);
}

TEST(OctomapSlices, AreLimitedToTheTypesOfAMap) {
  const testing::TempDir dir;
  const std::string path = testing::write_text(
      dir / "big.ot", testing::tree_file(false, testing::node(0, 1) + testing::node(kHit, 0), 2));
  const Error error = testing::error_of([&] { open(octomap(), path, {{"mode", "slices"}}); });
  EXPECT_EQ(error.code(), ErrorCode::kLimit);
  EXPECT_THAT(error.hint(), HasSubstr("z_min"));
  EXPECT_EQ(error.path(), path);
  EXPECT_EQ(open(octomap(), path, {{"mode", "slices"}, {"z_min", "-0.3"}})->header().types.size(), 3u);
}

TEST(OctomapReader, CountsUndecidedVoxelsAsLost) {
  const testing::TempDir dir;
  ::octomap::OcTree tree(0.1);
  tree.setNodeValue(key(0, 0, 0), 0.0f);
  tree.setNodeValue(key(9, 0, 0), kHit);
  testing::Collected findings;
  const Map map =
      collect(*open(octomap(), testing::save_ot(tree, dir / "half.ot"), {{"mode", "slices"}}, &findings));
  ASSERT_EQ(findings.losses().size(), 1u);
  EXPECT_THAT(findings.losses()[0], HasSubstr("1 known voxels of probability 0.5"));
  EXPECT_EQ(masses_at(map, "occupancy_z32768", 0.05, 0.05, 7), std::pair(0.0f, 0.0f));
}

TEST(OctomapReader, ADatumWholeCellsAwayGivesTheSameCells) {
  const testing::TempDir dir;
  const std::string path = small_tree(dir);
  const Map a = collect(*open(octomap(), path)), b = collect(*open(octomap(), path, {{"datum", "-3.3,7.7"}}));
  EXPECT_EQ(b.header().frame.datum_x_um, -3'300'000);
  for (double x = -1; x < 1; x += 0.1) {
    for (double y = -1; y < 1; y += 0.1) {
      EXPECT_EQ(masses_at(a, "occupancy", x + 0.05, y + 0.05, 7),
                masses_at(b, "occupancy", x + 0.05, y + 0.05, 7));
    }
  }
}

TEST(OctomapReader, AnotherEdgeIsRegridded) {
  const testing::TempDir dir;
  const auto source = open(octomap(), small_tree(dir), {{"edge_m", "10"}});
  EXPECT_EQ(source->header().frame.edge_um, 10'000'000);
  const Map map = collect(*source, false);
  double lambda = 0;
  for (const auto& [k, patch] : map.by_key()) {
    for (const float o : patch.layers.at(0).plane(0)) lambda -= std::log1p(-static_cast<double>(o));
  }
  EXPECT_NEAR(lambda, -3 * std::log(0.2), 1e-4) << "evidence adds over area";
}

TEST(OctomapReader, AnEmptyTreeIsAnEmptyMap) {
  const testing::TempDir dir;
  for (const bool binary : {false, true}) {
    const auto path = testing::write_text(dir / "empty", testing::tree_file(binary, "", 0));
    EXPECT_EQ(collect(*open(octomap(), path)).size(), 0u);
    EXPECT_EQ(collect(*open(octomap(), path, {{"mode", "slices"}})).size(), 0u);
  }
}

}  // namespace
}  // namespace apgm::converters
