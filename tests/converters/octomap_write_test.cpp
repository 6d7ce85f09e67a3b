#include <cmath>
#include <random>

#include "apgm/core/layer.hpp"
#include "tests/converters/octomap_support.hpp"

namespace apgm::converters {
namespace {

using testing::collect;
using testing::open;
using testing::write;

using ::testing::Contains;
using testing::differing_leaves;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::key;

MapHeader flat_header(std::int64_t edge_um = 12'800'000) {
  MapHeader header;
  header.frame.edge_um = edge_um;
  header.types = TypeTable({LayerType::occupancy(), LayerType::semantic("road", {"Road", "Blocked"})});
  return header;
}

void set(Map& map, PatchIndex patch, CellIndex cell, int step, float occupied, float free) {
  Layer& layer = map.layer(patch, 0, step);
  layer.at(0, cell) = occupied;
  layer.at(1, cell) = free;
}

TEST(OctomapRoundTrip, RealTreeKeepsEveryLeaf) {
  const std::string original = testing::real_data("octomap/geb079.bt");
  if (original.empty()) GTEST_SKIP() << "octomap/geb079.bt is not there";
  const testing::TempDir dir;
  testing::Collected findings;
  const Map map = collect(*open(octomap(), original, {{"mode", "slices"}}, &findings));
  EXPECT_EQ(map.header().frame.edge_um, 10'240'000);
  write(octomap(), map, dir / "back.bt", {}, &findings);
  EXPECT_THAT(findings.list, IsEmpty());

  ::octomap::OcTree a(0.1), b(0.1);
  ASSERT_TRUE(a.readBinary(original));
  ASSERT_TRUE(b.readBinary(dir / "back.bt"));
  EXPECT_EQ(a.getResolution(), b.getResolution());
  EXPECT_EQ(differing_leaves(a, a.getRoot(), b, b.getRoot(), [](float x, float y) { return x == y; }), 0u);
}

TEST(OctomapRoundTrip, ProbabilitiesSurviveInOt) {
  const testing::TempDir dir;
  std::mt19937 random(11);
  RecordProperty("seed", 11);
  std::uniform_int_distribution<int> place(-40, 40);
  std::uniform_real_distribution<float> value(-12, 12);
  ::octomap::OcTree tree(0.07);
  tree.setClampingThresMin(0);
  tree.setClampingThresMax(1);
  for (int i = 0; i < 5000; ++i)
    tree.setNodeValue(key(place(random), place(random), place(random)), value(random));
  for (int x = 64; x < 72; ++x) {
    for (int y = 64; y < 72; ++y) {
      for (int z = 64; z < 72; ++z) tree.setNodeValue(key(x, y, z), 1.5f);
    }
  }
  tree.updateInnerOccupancy();
  tree.prune();
  const auto source = open(octomap(), testing::save_ot(tree, dir / "a.ot"), {{"mode", "slices"}});
  testing::Collected findings;
  write(octomap(), *source, dir / "b.ot", {}, &findings);
  EXPECT_THAT(findings.list, IsEmpty());
  const auto back = testing::load_ot(dir / "b.ot");
  ASSERT_TRUE(back);
  EXPECT_EQ(back->getResolution(), 0.07);
  EXPECT_EQ(back->size(), tree.size()) << "pruned alike";
  const auto near = [](float x, float y) {
    const auto probability = [](double l) { return 1 / (1 + std::exp(-l)); };
    return std::fabs(probability(x) - probability(y)) < 6e-8;
  };
  EXPECT_EQ(differing_leaves(tree, tree.getRoot(), *back, back->getRoot(), near), 0u);
}

TEST(OctomapRoundTrip, OddResolutionsComeBackEqual) {
  const testing::TempDir dir;
  for (const double resolution : {1.0 / 3, 0.123456789, 7.7, 0.0123}) {
    ::octomap::OcTree tree(resolution);
    tree.setNodeValue(key(-5, 9, 4), 2.0f);
    tree.setNodeValue(key(1000, -1000, -7), -2.0f);
    tree.updateInnerOccupancy();
    const std::string bytes = testing::read_text(testing::save_ot(tree, dir / "a.ot"));
    // OctoMap itself writes six digits; the file's own number is what counts.
    const double written = testing::load_ot(dir / "a.ot")->getResolution();
    write(octomap(), *open(octomap(), dir / "a.ot", {{"mode", "slices"}}), dir / "b.ot", {}, nullptr, "",
          true);
    const auto back = testing::load_ot(dir / "b.ot");
    EXPECT_EQ(back->getResolution(), written);
    EXPECT_NE(back->search(key(-5, 9, 4)), nullptr) << resolution;
    EXPECT_NE(back->search(key(1000, -1000, -7)), nullptr) << resolution;
    EXPECT_EQ(back->getNumLeafNodes(), 2u);
  }
}

TEST(OctomapWriter, FillsTheSlab) {
  const testing::TempDir dir;
  Map map(flat_header());
  set(map, {0, 0}, {3, 4}, 7, 0.6f, 0);
  set(map, {-1, 0}, {127, 0}, 7, 0, 0.6f);
  write(octomap(), map, dir / "one.ot");
  auto tree = testing::load_ot(dir / "one.ot");
  EXPECT_EQ(tree->getNumLeafNodes(), 2u);
  ASSERT_NE(tree->search(key(3, 4, 0)), nullptr);
  EXPECT_NEAR(tree->search(key(3, 4, 0))->getOccupancy(), 0.8, 1e-6);
  EXPECT_NEAR(tree->search(key(-1, 0, 0))->getOccupancy(), 0.2, 1e-6);

  write(octomap(), map, dir / "slab.ot", {{"z_min", "-0.2"}, {"z_max", "0.3"}});
  tree = testing::load_ot(dir / "slab.ot");
  tree->expand();
  EXPECT_EQ(tree->getNumLeafNodes(), 10u);
  EXPECT_NE(tree->search(key(3, 4, -2)), nullptr);
  EXPECT_NE(tree->search(key(3, 4, 2)), nullptr);
  EXPECT_EQ(tree->search(key(3, 4, 3)), nullptr);
}

TEST(OctomapWriter, NamesWhatIsLost) {
  const testing::TempDir dir;
  Map map(flat_header());
  set(map, {0, 0}, {3, 4}, 7, 0.6f, 0.1f);
  map.layer({0, 0}, 1, 5).at(0, {1, 1}) = 0.5f;
  testing::Collected findings;
  write(octomap(), map, dir / "a.bt", {}, &findings);
  EXPECT_THAT(findings.losses(), Contains(HasSubstr("1 cells keep only whether")));
  EXPECT_THAT(findings.losses(), Contains(HasSubstr("both occupied and free")));
  EXPECT_THAT(findings.losses(), Contains(HasSubstr("layer 'road' is left out: 1 patches")));
  ::octomap::OcTree tree(0.1);
  ASSERT_TRUE(tree.readBinary(dir / "a.bt"));
  EXPECT_TRUE(tree.isNodeOccupied(tree.search(key(3, 4, 0))));
}

TEST(OctomapWriter, SplitsCoarserCells) {
  const testing::TempDir dir;
  Map map(flat_header());
  set(map, {0, 0}, {3, 4}, 7, 0.6f, 0);
  set(map, {1, 0}, {0, 0}, 5, 0.9f, 0);
  write(octomap(), map, dir / "a.ot");
  auto tree = testing::load_ot(dir / "a.ot");
  tree->expand();
  EXPECT_EQ(tree->getNumLeafNodes(), 17u);
  EXPECT_NEAR(tree->search(key(131, 3, 0))->getOccupancy(), 0.5 + 0.134036 / 2, 1e-6) << "split16 of 0.9";
}

TEST(OctomapWriter, MovesToTheOrigin) {
  const testing::TempDir dir;
  MapHeader header = flat_header();
  header.frame.datum_x_um = 580'000'000'000;
  header.frame.datum_y_um = 5'360'000'000'000;
  Map map(header);
  set(map, {0, 0}, {3, 4}, 7, 0.6f, 0);
  const Error error = testing::error_of([&] { write(octomap(), map, dir / "a.ot"); });
  EXPECT_EQ(error.code(), ErrorCode::kLimit);
  EXPECT_THAT(error.hint(), HasSubstr("origin=X,Y"));
  EXPECT_EQ(dir.list().size(), 0u);
  write(octomap(), map, dir / "a.ot", {{"origin", "580000,5360000"}});
  EXPECT_NE(testing::load_ot(dir / "a.ot")->search(key(3, 4, 0)), nullptr);
  testing::Collected findings;
  write(octomap(), map, dir / "b.ot", {{"origin", "580000.05,5360000"}}, &findings);
  EXPECT_THAT(findings.losses(), Contains(HasSubstr("regridded")));
  EXPECT_NE(testing::load_ot(dir / "b.ot")->search(key(2, 4, 0)), nullptr);
}

TEST(OctomapWriter, EmptyMapsAreEmptyTrees) {
  const testing::TempDir dir;
  const Map map(flat_header());
  for (const char* name : {"a.bt", "a.ot"}) {
    write(octomap(), map, dir / name);
    EXPECT_EQ(collect(*open(octomap(), dir / name)).size(), 0u);
  }
}

TEST(OctomapWriter, RefusesWhatItCannotDo) {
  const testing::TempDir dir;
  Map map(flat_header());
  set(map, {0, 0}, {3, 4}, 7, 0.6f, 0);
  const auto code = [&](const std::string& path, const Settings& settings, const std::string& layer = "") {
    return testing::error_of([&] { write(octomap(), map, path, settings, nullptr, layer); }).code();
  };
  EXPECT_EQ(code(dir / "a.txt", {}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code(dir / "a.bt", {{"z_min", "2"}, {"z_max", "1"}}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code(dir / "a.bt", {{"z_min", "1e6"}}), ErrorCode::kLimit);
  EXPECT_EQ(code(dir / "a.bt", {{"mode", "slices"}}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code(dir / "a.bt", {}, "road"), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code(dir / "a.bt", {}, "nothing"), ErrorCode::kInvalidArgument);
  testing::write_text(dir / "b.bt", "old");
  EXPECT_EQ(code(dir / "b.bt", {}), ErrorCode::kOutput);
  EXPECT_EQ(testing::read_text(dir / "b.bt"), "old");
  EXPECT_EQ(dir.list().size(), 1u);
}

TEST(OctomapWriter, SameMapSameBytes) {
  const testing::TempDir dir;
  Map map(flat_header());
  for (int i = 0; i < 100; ++i) set(map, {i % 7, i % 3}, {i, i}, 7, 0.6f, 0);
  ::testing::internal::CaptureStderr();
  write(octomap(), map, dir / "a.bt");
  write(octomap(), map, dir / "b.bt");
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(testing::read_text(dir / "a.bt"), testing::read_text(dir / "b.bt"));
}

TEST(OctomapWriter, AnEmptyMapBetweenCellsLosesNothing) {
  const testing::TempDir dir;
  MapHeader header;
  header.types = TypeTable({LayerType::occupancy()});
  testing::Collected findings;
  testing::write(octomap(), Map(header), dir / "a.ot", {{"origin", "0.01,0"}}, &findings);
  EXPECT_TRUE(findings.losses().empty());
}

}  // namespace
}  // namespace apgm::converters
