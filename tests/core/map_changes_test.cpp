#include "apgm/core/map_changes.hpp"

#include <gmock/gmock.h>

#include "apgm/core/error.hpp"
#include "random_map.hpp"

namespace apgm {
namespace {

using test::difference;
using test::random_map;

/// What a look that knows both maps would say; the maps have the same types.
MapChanges changes_between(const Map& before, const Map& after) {
  MapChanges changes{Map(after.header()), {}};
  for (const auto& [key, patch] : after.by_key()) {
    for (const auto& [type, layer] : patch.layers) {
      const Layer* old = before.find(patch.index, type);
      if (old == nullptr || !same_cells(*old, layer)) changes.changed.patch(patch.index).layers[type] = layer;
    }
  }
  for (const auto& [key, patch] : before.by_key()) {
    for (const auto& [type, layer] : patch.layers) {
      if (after.find(patch.index, type) == nullptr) {
        changes.gone.push_back({patch.index, before.header().types[type].name});
      }
    }
  }
  return changes;
}

TEST(MapChangesTest, TurnAnyMapIntoAnyOther) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Map map = random_map(seed);
    const Map after = random_map(seed + 1000);
    apply(changes_between(map, after), map);
    EXPECT_EQ(difference(map, after), "");
  }
}

TEST(MapChangesTest, NewTypesAreAddedAndLayersFollowTheirNames) {
  MapHeader narrow;
  narrow.types = TypeTable({LayerType::occupancy("m")});
  Map map(narrow);
  map.layer({0, 0}, 0, 2).plane(0)[3] = 0.5f;
  MapHeader wide;
  wide.types = TypeTable({LayerType::occupancy("a"), LayerType::occupancy("m"), LayerType::real("z", {"v"})});
  MapChanges changes{Map(wide), {}};
  changes.changed.layer({1, 0}, 0, 1).plane(1)[0] = 0.25f;
  changes.changed.layer({1, 0}, 1, 1).plane(1)[0] = 0.75f;

  apply(changes, map);

  ASSERT_EQ(map.header().types, wide.types);
  EXPECT_EQ(map.find({0, 0}, 0), nullptr);
  ASSERT_NE(map.find({0, 0}, 1), nullptr);
  EXPECT_EQ(map.find({0, 0}, 1)->plane(0)[3], 0.5f);
  EXPECT_EQ(map.find({1, 0}, 0)->plane(1)[0], 0.25f);
  EXPECT_EQ(map.find({1, 0}, 1)->plane(1)[0], 0.75f);
}

TEST(MapChangesTest, TypesOfTheMapAloneStay) {
  MapHeader wide;
  wide.types = TypeTable({LayerType::occupancy("a"), LayerType::occupancy("m")});
  Map map(wide);
  map.layer({0, 0}, 1, 1).plane(0)[0] = 0.5f;
  MapHeader narrow;
  narrow.types = TypeTable({LayerType::occupancy("a")});
  MapChanges changes{Map(narrow), {}};
  changes.changed.layer({0, 0}, 0, 1).plane(0)[0] = 0.25f;
  apply(changes, map);
  EXPECT_EQ(map.find({0, 0}, 0)->plane(0)[0], 0.25f);
  EXPECT_EQ(map.find({0, 0}, 1)->plane(0)[0], 0.5f);
}

TEST(MapChangesTest, PatchesWithoutLayersGo) {
  Map map(random_map(1).header());
  map.layer({2, 3}, 0, 1).plane(0)[0] = 0.5f;
  const MapChanges changes{Map(map.header()), {{{2, 3}, map.header().types[0].name}, {{9, 9}, "height"}}};
  apply(changes, map);
  EXPECT_EQ(map.size(), 0u);
}

TEST(MapChangesTest, AnotherFrameOrSpaceIsRefusedAndNothingChanges) {
  Map map = random_map(3);
  const Map before = map;
  MapHeader moved = map.header();
  moved.frame.datum_x_um += 1;
  EXPECT_THROW(apply({Map(moved), {}}, map), Error);

  MapHeader other = map.header();
  other.types = TypeTable({LayerType::semantic("occupancy", {"a", "b"})});
  EXPECT_THROW(apply({Map(other), {{{0, 0}, "height"}}}, map), Error);
  EXPECT_EQ(difference(map, before, true), "");
}

}  // namespace
}  // namespace apgm
