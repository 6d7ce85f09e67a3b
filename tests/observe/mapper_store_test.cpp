#include <gmock/gmock.h>

#include "apgm/core/error.hpp"
#include "apgm/format/message.hpp"
#include "apgm/format/scratch_map.hpp"
#include "apgm/observe/mapper.hpp"
#include "drives.hpp"
#include "temp_dir.hpp"

namespace apgm {
namespace {

using test::coarse_options;
using test::difference;
using test::disc;
using test::drive;
using test::DriveOptions;
using test::kSecond;
using test::MemoryStore;
using test::parking;
using test::road;
using test::TempDir;

Map to_map(const PatchSource& source) {
  Map map(source.header());
  const auto cursor = source.patches();
  PatchInfo patch;
  while (cursor->next(patch)) {
    for (const LayerInfo& info : patch.layers) source.load(info, map.patch(info.patch).layers[info.type]);
  }
  return map;
}

TEST(MapperStoreTest, TheFinalMapDoesNotDependOnTheMemory) {
  TempDir dir;
  for (const bool profiles : {false, true}) {
    for (const double ageing : {1.0, 0.7}) {
      for (std::uint64_t seed = 0; seed < 6; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed) + " ageing " + std::to_string(ageing));
        std::optional<Map> expected;
        for (const std::uint64_t memory : {0, 1, 20'000, 100'000}) {
          MapperOptions options = coarse_options();
          options.ageing_per_s = ageing;
          options.max_memory_bytes = memory;
          MapHeader header;
          ScratchMap scratch(header, dir.path());
          Mapper mapper(header.frame, Models{}, options, &scratch);
          int calls = 0;
          drive(mapper, seed, {60, profiles, true}, [&] {
            if (++calls % 17 == 0) mapper.flush();
            if (memory == 0 || profiles) return;
            std::uint64_t bytes = 0;
            for (const auto& t : mapper.map().summary().types) bytes += t.raw_bytes;
            ASSERT_LE(bytes, memory);
          });
          mapper.flush();
          EXPECT_EQ(mapper.map().size(), 0u);
          const Map all = to_map(scratch);
          EXPECT_GT(all.size(), 0u);
          if (!expected) {
            expected = all;
          } else {
            ASSERT_EQ(difference(*expected, all, true), "") << memory;
          }
        }
      }
    }
  }
}

TEST(MapperStoreTest, TheSameCallsGiveTheSameMapWithAStoreInMemory) {
  TempDir dir;
  MapperOptions options = coarse_options();
  options.ageing_per_s = 0.8;
  options.max_memory_bytes = 30'000;
  ScratchMap scratch(MapHeader{}, dir.path());
  MemoryStore memory{Frame{}};
  Mapper a(Frame{}, Models{}, options, &scratch), b(Frame{}, Models{}, options, &memory);
  for (Mapper* mapper : {&a, &b}) {
    drive(*mapper, 99, {120}, [] {});
    mapper->flush();
  }
  EXPECT_EQ(difference(to_map(scratch), memory.map, true), "");
}

TEST(MapperStoreTest, ChangesReproduceTheMapAtEveryLook) {
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    MapperOptions options = coarse_options();
    options.ageing_per_s = seed % 2 == 0 ? 1.0 : 0.5;
    options.max_memory_bytes = seed % 3 == 0 ? 40'000 : 0;
    MemoryStore store{Frame{}};
    Mapper mapper(Frame{}, Models{}, options, &store);
    Map copy(mapper.map().header());
    test::Random random(seed);
    std::size_t gone = 0;
    drive(mapper, seed, {80}, [&] {
      if (random.chance(0.4)) return;
      const MapChanges changes = changes_from_bytes(to_bytes(mapper.take_changes()));
      gone += changes.gone.size();
      apply(changes, copy);
      ASSERT_EQ(difference(copy, mapper.map(), true), "");
      ASSERT_EQ(copy.header().types, mapper.map().header().types);
      const MapChanges none = mapper.take_changes();
      ASSERT_EQ(none.changed.size(), 0u);
      ASSERT_TRUE(none.gone.empty());
    });
    EXPECT_GT(gone, 0u);
  }
}

TEST(MapperStoreTest, ChangesAreOnlyWhatChanged) {
  Mapper mapper(Frame{}, Models{}, coarse_options());
  test::Random random(1);
  mapper.add(test::random_scan(random, {0, 0}, 0));
  mapper.take_changes();
  mapper.add(test::random_scan(random, {200, 200}, 1));
  const MapChanges changes = mapper.take_changes();
  EXPECT_GT(changes.changed.size(), 0u);
  EXPECT_LT(changes.changed.size(), mapper.map().size());
}

/// The layers of one type with their steps.
std::map<PatchIndex, int> steps_of(const Map& map, const std::string& name) {
  std::map<PatchIndex, int> steps;
  const TypeId type = *map.header().types.find(name);
  for (const auto& [key, patch] : map.by_key()) {
    const auto it = patch.layers.find(type);
    if (it != patch.layers.end()) steps[patch.index] = it->second.step();
  }
  return steps;
}

TEST(MapperStoreTest, AnotherProfileHoldsWithinOneStepAndLosesNothingItWants) {
  MemoryStore store{Frame{}};
  Mapper mapper(Frame{}, Models{}, coarse_options(), &store);
  mapper.set_profile(road());
  mapper.move_to({0, 0}, 0);
  test::Random random(5);
  for (int i = 0; i < 30; ++i) {
    mapper.add(test::random_scan(random, {0, 0}, i));
    mapper.add(test::random_image(random, {0, 0}, i));
  }
  const Map wide = mapper.map();
  const auto wide_steps = steps_of(wide, "occupancy");
  const Frame& frame = wide.header().frame;
  for (const auto& [patch, step] : wide_steps) {
    EXPECT_EQ(road().required_step(frame, patch, "occupancy", {0, 0}), step);
  }

  mapper.set_profile(parking());
  EXPECT_EQ(difference(mapper.map(), wide), "") << "holds from the next call on";
  const MapperReport report = mapper.move_to({0, 0}, 100);
  EXPECT_GT(report.patches_dropped, 0u);
  std::size_t wanted = 0;
  for (const auto& [patch, step] : wide_steps) {
    const auto required = parking().required_step(frame, patch, "occupancy", {0, 0});
    const auto steps = steps_of(mapper.map(), "occupancy");
    ASSERT_EQ(steps.contains(patch), required.has_value());
    if (!required) continue;
    ++wanted;
    ASSERT_EQ(steps.at(patch), *required);
    ASSERT_EQ(steps.at(patch), 5);
    ASSERT_EQ(step, 4);
    // No evidence for an obstacle is lost: the sum of lambda is the same.
    const TypeId type = *wide.header().types.find("occupancy");
    double before = 0, after = 0;
    for (const float m : wide.find(patch, type)->plane(0)) before -= std::log1p(-static_cast<double>(m));
    for (const float m : mapper.map().find(patch, type)->plane(0))
      after -= std::log1p(-static_cast<double>(m));
    ASSERT_NEAR(after, before, 1e-4 * before + 1e-6);
  }
  EXPECT_GT(wanted, 0u);
  EXPECT_TRUE(steps_of(mapper.map(), "semantics").empty());

  // What left lies in the store as it was, and comes back when it is wanted again.
  mapper.set_profile(road());
  mapper.move_to({0, 0}, 200);
  EXPECT_EQ(steps_of(mapper.map(), "occupancy"), wide_steps);
  EXPECT_EQ(store.map.size(), 0u);
  const TypeId semantics = *wide.header().types.find("semantics");
  for (const auto& [patch, step] : steps_of(wide, "semantics")) {
    ASSERT_NE(mapper.map().find(patch, semantics), nullptr);
    EXPECT_TRUE(same_cells(*mapper.map().find(patch, semantics), *wide.find(patch, semantics)));
  }
}

TEST(MapperStoreTest, LayersOfAPatchMayLeaveAndComeBackAtDifferentTimes) {
  MemoryStore store{Frame{}};
  Mapper mapper(Frame{}, Models{}, coarse_options(), &store);
  test::Random random(8);
  mapper.move_to({6, 6}, 0);
  mapper.add(test::random_scan(random, {6, 6}, 0));
  mapper.add(test::random_image(random, {6, 6}, 0));
  const Map all = mapper.map();
  ASSERT_EQ(all.find({0, 0})->layers.size(), 2u);

  const auto switch_to = [&](Profile profile) {
    mapper.set_profile(std::move(profile));
    mapper.move_to({6, 6}, 0);
  };
  switch_to({"", {disc("semantics", 100, 0.8)}});
  EXPECT_EQ(mapper.map().find({0, 0})->layers.size(), 1u);
  EXPECT_EQ(store.map.find({0, 0})->layers.size(), 1u);
  switch_to({"", {disc("occupancy", 0.1, 0.8)}});
  EXPECT_EQ(mapper.map().size(), 1u);
  EXPECT_EQ(store.map.find({0, 0})->layers.size(), 1u);
  switch_to({"", {{"semantics", 0.8, Ring{5000, 5001}}}});
  EXPECT_EQ(mapper.map().size(), 0u);
  EXPECT_EQ(store.map.find({0, 0})->layers.size(), 2u);
  switch_to({"", {disc("semantics", 100, 0.8), disc("occupancy", 100, 0.8)}});
  EXPECT_EQ(difference(mapper.map(), all, true), "");
  EXPECT_EQ(store.map.size(), 0u);
}

TEST(MapperStoreTest, AStoredLayerComesBackAtTheStepThatIsWantedThen) {
  MemoryStore store{Frame{}};
  Mapper mapper(Frame{}, Models{}, coarse_options(), &store);
  test::Random random(8);
  mapper.move_to({0, 0}, 0);
  mapper.add(test::random_scan(random, {0, 0}, 0));
  mapper.set_profile(Profile{"", {disc("occupancy", 1, 0.8)}});
  mapper.move_to({5000, 0}, 1);
  EXPECT_EQ(mapper.map().size(), 0u);
  mapper.set_profile(Profile{"", {disc("occupancy", 100, 3.2)}});
  const MapperReport report = mapper.move_to({0, 0}, 2);
  EXPECT_GT(report.layers_resampled, 0u);
  for (const auto& [patch, step] : steps_of(mapper.map(), "occupancy")) EXPECT_EQ(step, 2);
}

TEST(MapperStoreTest, WithoutAStoreWhatLeavesIsGone) {
  Mapper mapper(Frame{}, Models{}, coarse_options());
  test::Random random(8);
  mapper.add(test::random_scan(random, {0, 0}, 0));
  mapper.set_profile(parking());
  mapper.move_to({5000, 0}, 1);
  mapper.move_to({0, 0}, 2);
  EXPECT_EQ(mapper.map().size(), 0u);
}

TEST(MapperStoreTest, AStoreThatFailsLosesNothing) {
  MemoryStore store{Frame{}};
  Mapper mapper(Frame{}, Models{}, coarse_options(), &store);
  test::Random random(8);
  mapper.add(test::random_scan(random, {0, 0}, 0));
  const Map before = mapper.map();
  store.fails = true;
  EXPECT_THROW(mapper.flush(), std::runtime_error);
  EXPECT_EQ(difference(mapper.map(), before, true), "");
  mapper.set_profile(parking());
  EXPECT_THROW(mapper.move_to({5000, 0}, 1), std::runtime_error);
  EXPECT_EQ(difference(mapper.map(), before, true), "");
  store.fails = false;
  mapper.move_to({5000, 0}, 2);
  EXPECT_EQ(difference(store.map, before, true), "");
}

TEST(MapperStoreTest, AWrongProfileLeavesTheOldOne) {
  Mapper mapper(Frame{}, Models{}, coarse_options());
  mapper.set_profile(parking());
  mapper.move_to({0, 0}, 0);
  EXPECT_THROW(mapper.set_profile(Profile{"", {disc("no_such_layer", 10, 0.4)}}), Error);
  EXPECT_THROW(mapper.set_profile(Profile{"", {disc("occupancy", 10, 0.3)}}), Error);
  test::Random random(8);
  mapper.add(test::random_scan(random, {0, 0}, 1));
  for (const auto& [patch, step] : steps_of(mapper.map(), "occupancy")) EXPECT_EQ(step, 5);
}

}  // namespace
}  // namespace apgm
